"""What a process pays before it does anything: each call is a process of its own."""

import subprocess
import sys

KERNEL = "import hipuq.cea.eigenvalues as own; own.eigenvalues(numpy.eye(18)[None])"
LAPACK = "numpy.linalg.eigvals(numpy.eye(18)[None])"


def python(*arguments):
    return lambda: subprocess.run([sys.executable, *arguments], capture_output=True, check=True)


def bench_import(against):
    against(
        "import hipuq", python("-c", "import hipuq"), python("-c", "import numpy"), against="import numpy"
    )


def bench_help(against):
    against(
        "hipuq --help", python("-m", "hipuq", "--help"), python("-c", "import numpy"), against="import numpy"
    )


def bench_first_eigenvalues(against):
    against(
        "first eigenvalues of a process, its start counted in",
        python("-c", f"import numpy; {KERNEL}"),
        python("-c", f"import numpy; {LAPACK}"),
        against="numpy.linalg.eigvals",
    )
