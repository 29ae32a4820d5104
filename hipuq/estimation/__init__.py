"""From outcomes to labelled numbers: moments, limits, names; what all methods share."""
