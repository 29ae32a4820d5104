"""Published, certified and closed-form values that the tests compare with; data only.

Sources
-------
- O2016: Oberst, Zhang, Campbell, Morlock, Lai, Hoffmann, "Towards the understanding of hip squeak
  in total hip arthroplasty using analytical contact models with uncertainty", INTER-NOISE 2016,
  p. 5539: equations 2 to 7 and Table 1.
- Certified: what the equations of O2016 give, by exact rational characteristic polynomials of the
  matrices, with rigorously enclosed roots, and bisection in the friction coefficient.
- Closed forms: Hoffmann, Fischer, Allgaier, Gaul, Mech. Res. Commun. 29 (2002) 197; Hulten, SAE
  932965 (1993), with Sinou and Jezequel, Eur. J. Mech. A 26 (2007) 106; Ziegler, Ing.-Arch. 20
  (1952) 49, the pendulum under a follower load with masses 2 and 1, unit lengths and springs.
"""

import math

# O2016, Table 1 and text: kg, N/m, degrees; springs 1 to 10, oscillators 1 to 9.
MASS = 22.22
SPRING_STIFFNESS = 1.05e9
CONTACT_STIFFNESS = 3.98e9
SPRING_ANGLES = (78.75, 101.25, 123.75, 146.25, 168.75, 191.25, 213.75, 236.25, 258.75, 281.25)
CONTACT_ANGLES = (180.0, 202.5, 225.0, 247.5, 270.0, 292.5, 315.0, 337.5, 360.0)
FRICTION_ANGLES = (270.0, 292.5, 315.0, 337.5, 0.0, 22.5, 45.0, 67.5, 90.0)

# O2016 as the authors print it: lock-in of mode 15, which the ratio kc / k = 4.38 reproduces.
PRINTED_LOCK_IN_MODE_15 = 0.056
CALIBRATED_RATIO = 4.38

# Certified: natural frequencies without friction, nominal, all 9 in contact [Hz].
NATURAL_FREQUENCIES = (
    330.455, 652.793, 959.103, 1241.882, 1494.236, 1710.097, 1884.484, 2013.999, 2098.200,
    2134.450, 2160.562, 2167.206, 2169.873, 2171.097, 2171.728, 2172.076, 2172.272, 2172.373,
)  # fmt: skip

# Certified: friction at which one pair of modes after the other coalesces, all 9 in contact. Pairs
# change places in the order of frequencies on the way: far above they are those of modes 11 to 18.
ONSETS = {
    "oberst2016": (0.00949727246944, 0.0104569072808, 0.0127590938754, 0.0171403736060),
    "oberst2016-calibrated": (0.0530122, 0.0560347, 0.0620784, 0.0701032),
}

# Certified: first onset of the nominal ring with 8 in contact, by the oscillator left out.
FIRST_ONSET_WITHOUT = {
    1: 0.0099624848,
    2: 0.0095484843,
    3: 0.010311492,
    4: 0.0096860256,
    5: 0.011117236,
    6: 0.0096901832,
    7: 0.010325088,
    8: 0.0095502894,
    9: 0.0099636297,
}

# Certified: probability that any mode is unstable, friction uniform on 0 to 0.1, mean over the
# patterns with that many in contact.
PROBABILITY_ANY_UNSTABLE = {
    "oberst2016": {8: 0.89982788, 9: 0.9050272753},
    "oberst2016-calibrated": {8: 0.45333648, 9: 0.46987828},
}

# Certified: the same for single patterns of 8, nominal, by the oscillator left out.
PROBABILITY_WITHOUT = {5: 0.88882764, 2: 0.90451516}

# First onset of the preset oberst2016 at full contact with cosines of 60 digits: the pencil of the
# exact geometry, solved for the zero of the pair's squared gap in 60-digit arithmetic.
ONSET_OF_THE_EXACT_GEOMETRY = 0.0094972724694141030938


# A point where LAPACK shows two complex pairs and exact arithmetic none: kc / k, friction.
FALSE_FLUTTER = (1 / 0.2283, 0.0525)

# Closed forms, Hoffmann et al. 2002 with k1 = 11, k2 = 20, k3 = 11, angles 150 and 30 degrees.
HOFFMANN_ONSET = 0.472377492973330
HOFFMANN_OMEGA = math.sqrt(21)
HOFFMANN_PROBABILITY = 0.4095281338
"""Of instability for friction uniform on 0 to 0.8."""

# Closed forms, Hulten with frequencies 100 and 75 Hz: (damping 1, damping 2) -> onset.
HULTEN_ONSETS = {
    (0.0, 0.0): 7 / 24,
    (0.02, 0.02): 0.289367125523,
    (0.02, 0.06): 0.271790033822,
    (0.06, 0.02): 0.235551362646,
}
HULTEN_ONSET_VANISHING_DAMPING = 0.288675134595
HULTEN_PROBABILITY = 0.540114940841
"""Of instability, undamped, friction 0.3, frequency 2 of 75 Hz, frequency 1 uniform on 90 to 110 Hz: the
frequencies meet the onset at a ratio of 0.3 + sqrt(1.09), so (75 (0.3 + sqrt(1.09)) - 90) / 20."""

# Closed form, Ziegler's pendulum: the load at which flutter begins and the one at which it ends.
ZIEGLER_FLUTTER = (7 / 2 - math.sqrt(2), 7 / 2 + math.sqrt(2))
