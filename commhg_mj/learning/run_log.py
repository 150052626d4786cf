"""A run's numbers, update by update: a table, and TensorBoard's scalars beside it where that package is installed."""

import csv
from pathlib import Path

from ..base.files import naming, whole_file

LOG = "log.csv"


def find_writer() -> type | None:
    """TensorBoard's writer class, or None without the package."""
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError:
        return None
    return SummaryWriter


class Log:
    """Goes on before the row `first`: what a process that was killed has logged from that update on is dropped."""

    def __init__(self, folder, first: dict):
        self.path, kept = Path(folder) / LOG, []
        self.path.parent.mkdir(parents=True, exist_ok=True)
        if self.path.is_file():
            earlier = set(map(str, range(1, first["update"])))
            with open(self.path, newline="") as file:  # a row that was cut short lacks its last cells
                kept = [row for row in csv.DictReader(file) if row.get("update") in earlier and None not in row.values()]
        with whole_file(self.path) as draft, open(draft, "w", newline="") as file:
            writer = csv.DictWriter(file, list(first), extrasaction="ignore")
            writer.writeheader()
            writer.writerows(kept)
        writer = find_writer()
        self.scalars = writer(str(folder), purge_step=first["update"]) if writer else None

    def write(self, row: dict) -> None:
        """Append a row."""
        with naming(self.path), open(self.path, "a", newline="") as file:
            csv.DictWriter(file, list(row)).writerow(row)
        if self.scalars:
            for name, value in row.items():
                self.scalars.add_scalar(name, value, row["update"])
            self.scalars.flush()
