from . import cea as cea
from . import models as models
from . import plots as plots
from .comparison import compare as compare
from .contact import ContactPatterns as ContactPatterns
from .driver import design as design
from .driver import estimate as estimate
from .driver import run as run
from .errors import HipuqError as HipuqError
from .evaluation import evaluate as evaluate
from .fragility_curve import fragility as fragility
from .friction import integrate_friction as integrate_friction
from .inputs import Inputs as Inputs
from .models.onset import unstable_friction as unstable_friction
from .models.sensitivity import onset_sensitivity as onset_sensitivity
from .store import load_outcomes as load_outcomes
from .store import load_results as load_results
from .store import save_outcomes as save_outcomes
from .store import save_results as save_results
from .study import load_study as load_study
from .study import run_study as run_study
from .variation import relative as relative
from .variation import shift as shift

__version__: str
