"""The command line: run a study, show and report its results, list what there is."""

from __future__ import annotations

import logging
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

app = typer.Typer(
    name="hipuq",
    help="Uncertainty quantification of friction-induced instability of hip implants.",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

_DEBUG = False

INTERRUPTED = 130
"""Exit code after Ctrl-C, as of a shell."""

CONNECT = 10.0
"""Seconds for which the scheduler of a cluster is looked for."""


@app.callback()
def _common(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
) -> None:
    global _DEBUG
    _DEBUG = debug


@app.command()
def run(
    study: Annotated[Path, typer.Argument(help="Study folder or its study.toml.")],
    out: Annotated[
        Path | None, typer.Option("--out", help="Output folder; default results/<study> here.")
    ] = None,
    jobs: Annotated[int | None, typer.Option("--jobs", help="Threads; default all cores.")] = None,
    seed: Annotated[int | None, typer.Option("--seed", help="Seed in place of the study's.")] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on from what an earlier run left in the output folder.")
    ] = False,
    processes: Annotated[
        bool, typer.Option("--processes", help="Evaluate in processes in place of threads; --jobs of them.")
    ] = False,
    dask: Annotated[
        str | None,
        typer.Option(
            "--dask", help="Evaluate on the dask cluster whose scheduler has this ADDRESS.", metavar="ADDRESS"
        ),
    ] = None,
    on_error: Annotated[
        str,
        typer.Option("--on-error", help="What becomes of a sample that fails: mark it, or raise an error."),
    ] = "mark",
    max_failed: Annotated[
        float, typer.Option("--max-failed", help="Share of the samples of an analysis that may fail.")
    ] = 0.5,
    retry_failed: Annotated[
        bool, typer.Option("--retry-failed", help="With --resume, evaluate samples that failed again.")
    ] = False,
    dry_run: Annotated[
        bool,
        typer.Option(
            "--dry-run", help="Check the study, with --resume its output too, and count evaluations."
        ),
    ] = False,
) -> None:
    """Run a study: outcomes, results.nc, figures and report.html."""
    from hipuq.progress import log_to_stderr
    from hipuq.sampling import check_count
    from hipuq.study import load_study, run_study, would_keep

    if jobs is not None:
        check_count("--jobs", jobs)
    plan = load_study(study, seed=seed)
    typer.echo(f"{plan.title}\nseed {plan.seed}")
    for analysis in plan.analyses:
        typer.echo(
            f"  {analysis.name}: {analysis.method} of {', '.join(analysis.of)} with "
            f"{analysis.model.label}, {analysis.evaluations:,} evaluations"
            + (f", over {' and '.join(analysis.over)}" if analysis.over else "")
            + (f" (added by itself, as {analysis.like})" if analysis.like else "")
        )
    for problem in plan.problems:
        race = problem.race
        budgets = " to ".join(f"{budget:,}" for budget in sorted({race.budgets[0], race.budgets[-1]}))
        typer.echo(
            f"  {problem.group}: {', '.join(one.name for one in race.contenders)} with {race.label}, "
            f"{budgets} evaluations, {race.replicates:,} replicates, {problem.evaluations:,} evaluations"
        )
    typer.echo(f"  in all {plan.evaluations:,} evaluations")
    folder = out if out is not None else Path("results") / plan.name
    if dry_run:
        for line in would_keep(plan, folder) if resume else ():
            typer.echo(f"  {line}")
        return
    log_to_stderr()
    try:
        with _executor(processes, dask) as executor:
            tree = run_study(
                plan,
                folder,
                resume=resume,
                n_jobs=jobs,
                executor=executor,
                on_error=on_error,
                max_failed=max_failed,
                retry_failed=retry_failed,
                say=typer.echo,
            )
    except KeyboardInterrupt as stop:
        what = str(stop).partition(";")[0] or f"what was complete is in {folder}"
        _fail(f"interrupted: {what}; go on with --resume", INTERRUPTED)
    from hipuq.report.page import write_report

    page = write_report(tree, folder)
    typer.echo(f"results: {folder / 'results.nc'}\nreport: {page}")


@app.command()
def report(results: Annotated[Path, typer.Argument(help="Output folder or its results.nc.")]) -> None:
    """Write figures and report again, from stored results."""
    from hipuq.report.page import write_report
    from hipuq.store import load_results

    tree = load_results(results)
    typer.echo(f"report: {write_report(tree, results if results.is_dir() else results.parent)}")


@app.command()
def show(
    results: Annotated[Path, typer.Argument(help="Output folder or its results.nc.")],
    analysis: Annotated[
        str | None, typer.Option("--analysis", help="Show the tables of this analysis in full.")
    ] = None,
    everything: Annotated[bool, typer.Option("--all", help="Show those of every analysis.")] = False,
) -> None:
    """Show results in one screen of text."""
    from hipuq.report.text import show_results
    from hipuq.store import load_results

    show_results(load_results(results), analysis=analysis, everything=everything)


@app.command()
def onset(
    model: Annotated[str, typer.Option("--model", help="Name of the model.")] = "ring",
    preset: Annotated[str | None, typer.Option("--preset", help="Published set of values.")] = None,
    contact: Annotated[
        str | None, typer.Option("--contact", help="Oscillators in contact, such as 1,2,5; default all.")
    ] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", help="Parameter=value in place of the nominal one; may be repeated."),
    ] = None,
    growth_threshold: Annotated[
        float, typer.Option("--growth-threshold", help="Growth rate above which a mode is unstable [1/s].")
    ] = 0.0,
    smallest: Annotated[float, typer.Option("--min", help="Smallest friction.")] = 0.0,
    largest: Annotated[float, typer.Option("--max", help="Largest friction.")] = 0.1,
) -> None:
    """Print the unstable friction intervals of one configuration, and which boundaries are certified."""
    from hipuq.configuration import configured
    from hipuq.models import unstable_friction
    from hipuq.report.configuration import show_onset

    chosen, sample = configured(model, preset, contact, settings or [], growth_threshold)
    show_onset(unstable_friction(chosen, sample, lower=smallest, upper=largest))


@app.command("list")
def list_(what: Annotated[str, typer.Argument(help="models or methods")]) -> None:
    """List models with their presets, or methods with their options."""
    from hipuq.errors import unknown_name

    if what == "models":
        from hipuq.models import MODELS, PRESETS

        for name in MODELS:
            typer.echo(f"{name}: presets {', '.join(PRESETS[name])}")
    elif what == "methods":
        from hipuq.methods import METHODS
        from hipuq.methods.base import STAGES

        for name, method in METHODS.items():
            options: dict[str, object] = {}
            for stage in STAGES:
                # Several may take the same option: its first default is told.
                options = options | {k: v for k, v in method.options(stage).items() if k not in options}
            text = ", ".join(f"{key}={value!r}" for key, value in options.items())
            typer.echo(f"{name}: {method.title}; options {text}")
    else:
        raise unknown_name("list", what, ["models", "methods"])


@contextmanager
def _executor(processes: bool, dask: str | None) -> Iterator[object]:
    """Give what evaluates: nothing for threads, the word for processes, a client of dask's."""
    from hipuq.errors import InputError, StoreError

    if dask is None:
        yield "processes" if processes else None
        return
    if processes:
        raise InputError("--processes and --dask exclude each other: give one of them")
    try:
        from distributed import Client
        from distributed.comm.addressing import get_address_host_port
    except ImportError as error:
        raise InputError("--dask needs dask.distributed: install hipuq[dask]") from error
    # What it logs of a connection that is lost, the error says in a line.
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    try:
        # A client that never found its scheduler would look for it again when it is thrown away.
        with socket.create_connection(get_address_host_port(dask, strict=True), CONNECT):
            pass
        # Not the default one: xarray would take its locks for writing files.
        client: Any = Client(dask, timeout=CONNECT, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        raise StoreError(f"there is no dask scheduler at {dask!r}: {error}") from error
    with client:
        yield client


def command() -> None:
    """Run the command line as a program: after Ctrl-C it ends at once, whatever a model is still doing."""
    try:
        main()
    except SystemExit as end:
        if end.code != INTERRUPTED:
            raise
        import multiprocessing

        if children := multiprocessing.active_children():
            for child in children:
                child.terminate()
            raise
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(INTERRUPTED)


def main() -> None:
    """Run the command line; an error is one line and a non-zero exit code."""
    from hipuq.errors import HipuqError

    try:
        app()
    except HipuqError as error:
        if _DEBUG:
            raise
        _fail(str(error))
    except Exception as error:
        if _DEBUG:
            raise
        _fail(f"unexpected {type(error).__name__}: {error}; hipuq --debug shows where")


def _fail(message: str, code: int = 1) -> NoReturn:
    print(f"hipuq: {' '.join(message.split())}", file=sys.stderr)
    raise SystemExit(code)
