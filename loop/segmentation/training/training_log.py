"""The log of a training: a CSV table, and its curve."""

import csv
from pathlib import Path


def write_row(path: Path, step: int, rate: float, loss: float) -> None:
    """Append a row to the log; its first row names the columns."""
    path.parent.mkdir(parents=True, exist_ok=True)
    fresh = not path.exists()
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        if fresh:
            writer.writerow(["step", "rate", "loss"])
        writer.writerow([step, f"{rate:.3e}", f"{loss:.4f}"])


def read_log(path: Path) -> list[tuple[int, float, float]]:
    """Rows (step, rate, loss) by step; the later one where a resumed training logged a step twice."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = {int(row["step"]): (float(row["rate"]), float(row["loss"])) for row in csv.DictReader(file)}
    return [(step, *rows[step]) for step in sorted(rows)]


def plot_log(path: Path, picture: Path) -> None:
    """Draw loss and learning rate over the steps."""
    from matplotlib.figure import Figure

    steps, rates, losses = zip(*read_log(path), strict=True)
    figure = Figure(figsize=(7, 4), layout="constrained")
    axes = figure.subplots()
    axes.plot(steps, losses, color="tab:blue", label="loss")
    axes.set(xlabel="step", ylabel="weighted cross-entropy")
    beside = axes.twinx()
    beside.plot(steps, rates, color="tab:grey", linestyle="--", label="learning rate")
    beside.set_ylabel("learning rate")
    figure.legend(loc="upper right")
    figure.savefig(picture, dpi=120)
