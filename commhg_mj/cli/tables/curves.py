"""What `curves` prints: a row a run."""

from rich.table import Table

from ...study.learning_curves import REFERENCE, Study


def curves_table(study: Study, n_missions: int) -> Table:
    """Scores after imitation and at the end, and paired differences."""
    conditions = f"{study.scenario.name}, {study.links} links, {study.limitation} limitation"
    table = Table(title=f"{conditions}, {n_missions} held-out missions; {REFERENCE} {study.reference}", title_justify="left")
    for name in ("method", "CPU-min", "missions", "after imitation", "at the end", "gain", f"minus {REFERENCE}", "changes"):
        table.add_column(name, justify="left" if name == "method" else "right")
    for run in study.runs:
        intervals = map(str, (run.cloned, run.final, run.gain, run.margin))
        table.add_row(run.method, f"{run.minutes[-1]:.1f}", str(run.missions), *intervals, f"{run.changes:.3f}")
    return table
