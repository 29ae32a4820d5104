"""Compile hipuq/compiled into one shared library while the wheel is made.

The library is plain C that ctypes reads: no Python headers are needed, and one wheel serves every
Python. Why it is made this way: docs/decisions/0009-compiled-kernel-build.md.

``HIPUQ_COMPILED=require`` fails where the library cannot be made for every target of the machine,
``HIPUQ_COMPILED=no`` makes a wheel without it, and otherwise hipuq goes without what does not compile.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import platform
import runpy
import shlex
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from packaging.tags import platform_tags

FOLDER = "hipuq/compiled"
LIBRARY = {"darwin": "_kernel.dylib", "win32": "_kernel.dll"}.get(sys.platform, "_kernel.so")
ZIG = "ziglang~=0.17.1"  # its command line changes with the second number

FLAGS = (
    "-std=c11 -O3 -fPIC -fvisibility=hidden -fno-math-errno -fno-trapping-math -ffp-contract=off "
    "-Wall -Wextra -Werror=implicit-function-declaration"
).split()
X86_64 = {
    "avx512": "-mavx512f -mavx512dq -mavx512vl -mavx512bw -mfma -mprefer-vector-width=512".split(),
    "avx2": "-mavx2 -mfma".split(),
}
TARGETS: dict[str, list[str]] = {
    **(X86_64 if platform.machine() in ("x86_64", "AMD64") else {}),
    "baseline": [],
}

# Headers of the C library, the mathematical library and vectors: what is missing where a compiler is
# there but not complete, or too old.
TRIAL = """
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
typedef double pair __attribute__((vector_size(16)));
double trial(double x) { pair p = {x, x}; p = p * p; return hypot(p[0], sqrt(p[1])); }
"""


class CompilationError(Exception):
    """No library; the message says why in one line, ``output`` what the compiler said."""

    def __init__(self, reason: str, output: str = "") -> None:
        super().__init__(reason)
        self.output = output


class CustomBuildHook(BuildHookInterface[Any]):
    """Put the compiled library into the wheel; for an editable installation, beside its sources."""

    def dependencies(self) -> list[str]:
        """Ask for a compiler where the machine has none, and there is one to be had."""
        if self.wanted() == "no" or platform.machine().lower() not in ("x86_64", "amd64", "aarch64", "arm64"):
            return []
        with tempfile.TemporaryDirectory() as folder:
            return [] if own_compiler(Path(folder)) else [ZIG]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile before the files of the wheel are gathered."""
        # Lives as long as the hook: the wheel takes the library from there.
        self.folder = tempfile.TemporaryDirectory(prefix="hipuq-")
        library = self.compiled(Path(self.folder.name))
        if version == "editable":
            place(library, Path(self.root, FOLDER, LIBRARY))
        elif library:
            build_data["force_include"][str(library)] = f"{FOLDER}/{LIBRARY}"
            build_data["pure_python"] = False
            build_data["tag"] = f"py3-none-{platform_tag()}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove what the wheel has taken."""
        self.folder.cleanup()

    def wanted(self) -> str:
        """Return what the environment asks for: auto, require or no."""
        wanted = os.environ.get("HIPUQ_COMPILED") or "auto"
        if wanted not in ("auto", "require", "no"):
            self.app.abort(f"hipuq: HIPUQ_COMPILED is {wanted!r}; it may be auto, require or no")
        return wanted

    def compiled(self, folder: Path) -> Path | None:
        """Return the library, None if there is none, or end the build if there must be one."""
        wanted = self.wanted()
        if wanted == "no":
            return None
        try:
            return make_library(Path(self.root, FOLDER), folder, every_target=wanted == "require")
        except CompilationError as error:
            show(error.output)
            if wanted == "require":
                self.app.abort(f"hipuq: no compiled kernel, which HIPUQ_COMPILED=require asks for: {error}")
            self.app.display_warning(f"hipuq: no compiled kernel, LAPACK takes its place, slower: {error}")
            return None


def own_compiler(folder: Path) -> list[str] | None:
    """Return the machine's first C compiler that makes libraries for this Python, as words of a command."""
    (folder / "trial.c").write_text(TRIAL)
    # On Windows gcc does not align the stack for wide registers.
    usual = [] if sys.platform == "win32" else [["cc"], ["gcc"], ["clang"]]
    for compiler in (shlex.split(os.environ.get("CC", "")), *usual):
        if compiler and shutil.which(compiler[0]):
            with contextlib.suppress(CompilationError):
                link(compiler, ["trial.c"], "trial.so", folder)
                return compiler
    return None


def zig_compiler() -> list[str] | None:
    """Return the compiler of the package ziglang, if it is installed, as words of a command."""
    if importlib.util.find_spec("ziglang") is None:
        return None
    # By itself it would use whatever this very processor has, in every target.
    compiler = [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline"]
    if platform.libc_ver()[0] == "glibc":
        compiler += ["-target", f"{platform.machine()}-linux-gnu.2.28"]
    return compiler


def make_library(sources: Path, folder: Path, *, every_target: bool) -> Path:
    """Compile the kernel for each target that the compiler knows, and what chooses among them."""
    compiler = own_compiler(folder) or zig_compiler()
    if compiler is None:
        raise CompilationError("no C compiler works here, and ziglang is not installed")
    for source in sources.glob("*.[ch]"):
        shutil.copy(source, folder)  # so that no path of this machine gets into the library
    objects, have = [], []
    for target, flags in TARGETS.items():
        command = [*compiler, *FLAGS, *flags, f"-DTARGET={target}", "-c", "kernel.c", "-o", f"{target}.o"]
        try:
            show(run(command, folder))
        except CompilationError as error:
            if every_target or target == "baseline":
                raise
            show(f"hipuq: the kernel for {target} is left out\n{error.output}")
        else:
            objects.append(f"{target}.o")
            have.append(f"-DHAVE_{target.upper()}")
    made_of = runpy.run_path(str(sources / "sources.py"))["digest"](sources)
    have.append(f"-DHIPUQ_SOURCES={made_of:#x}ULL")
    show(link(compiler, [*have, "dispatch.c", *objects], LIBRARY, folder))
    return folder / LIBRARY


def link(compiler: list[str], parts: list[str], library: str, folder: Path) -> str:
    """Make a shared library that this Python can load, and return what the compiler says."""
    output = run([*compiler, *FLAGS, "-shared", "-s", *parts, "-o", library, "-lm"], folder)
    # In a process of its own, as a library may end the process that loads it.
    run([sys.executable, "-c", "import ctypes, sys; ctypes.CDLL(sys.argv[1])", str(folder / library)], folder)
    return output


def run(command: list[str], folder: Path) -> str:
    """Run a command in a folder, zig with its caches there, and return what it says."""
    caches = {f"ZIG_{which}_CACHE_DIR": str(folder / "zig") for which in ("LOCAL", "GLOBAL")}
    try:
        done = subprocess.run(
            command,
            cwd=folder,
            env=os.environ | caches,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
        )
    except OSError as error:
        raise CompilationError(f"{command[0]} does not run: {error}") from None
    if done.returncode:
        raise CompilationError(f"status {done.returncode} of {shlex.join(command)}", done.stdout)
    return done.stdout


def show(output: str) -> None:
    """Show what a compiler says where the front end shows what the build says."""
    if output:
        print(output.rstrip(), file=sys.stderr)


def place(library: Path | None, path: Path) -> None:
    """Put the library, or none, where the old one was; a process that has loaded that keeps it."""
    if library is None:
        path.unlink(missing_ok=True)
        return
    new = path.with_suffix(f".{os.getpid()}")
    shutil.copyfile(library, new)
    os.replace(new, path)


def platform_tag() -> str:
    """Return the tag of this machine; which other machines have what the library needs is not looked into."""
    return next(tag for tag in platform_tags() if not tag.startswith(("manylinux", "musllinux")))
