"""The comparison's figures, by name; each takes what it shows and returns a matplotlib figure."""

import numpy as np
from matplotlib.figure import Figure

from ...base.charts import new_figure, styled
from ...planning.link_pairs import CLASSES
from .message_counts import LONGEST, ROUTES
from .plan import MODELS, SHUFFLED
from .record_tables import column, latency_curves
from .sight import is_clear, reliability

COLOURS = {"abstract": "#7f7f7f", "abstract-fit": "#e69f00", "raycast": "#0072b2", SHUFFLED: "#cc79a7"}
CLASS_COLOURS = ("#0072b2", "#009e73", "#d55e00", "#7f7f7f")


@styled
def delivery_figure(links) -> Figure:
    """How likely links deliver under both models, one panel a class."""
    figure, axes = new_figure(11.0, 3.0, len(CLASSES), sharey=True)
    for k, (ax, name) in enumerate(zip(axes, CLASSES)):
        ours = links[links["kind"] == k]
        for model, column_name in (("abstract", "planar_delivered"), ("raycast", "ray_delivered")):
            if len(ours):
                label = f"{model}, {np.mean(~is_clear(ours, model)):.0%} obstructed"
                ax.ecdf(ours[column_name], color=COLOURS[model], label=label)
        ax.set(title=f"{name} ({len(ours):,})", xlabel="delivery probability", xlim=(-0.02, 1.02))
        _legend(ax, loc="upper left")
    axes[0].set_ylabel("share of links up to it")
    return figure


@styled
def reliability_figure(links) -> Figure:
    """Reliability diagram of the abstract delivery probability against ray-cast fates."""
    heard = np.random.default_rng(0).random(len(links)) < links["ray_delivered"]
    figure, ax = new_figure(4.2, 3.8)
    ax.plot([0, 1], [0, 1], color="#bbbbbb", lw=1)
    for k, name in enumerate(CLASSES):
        chosen = links["kind"] == k
        bins = reliability(links["planar_delivered"][chosen], heard[chosen]) if chosen.any() else []
        if bins:
            foretold, share, counts = np.array(bins).T
            ax.plot(foretold, share, "-", color=CLASS_COLOURS[k], lw=1, alpha=0.7)
            ax.scatter(foretold, share, 8 + 160 * counts / counts.sum(), color=CLASS_COLOURS[k], label=name)
    ax.set(xlabel="delivery foretold by the abstract model", ylabel="delivered by ray-cast links", xlim=(0, 1), ylim=(0, 1.02))
    ax.legend(frameon=False, loc="lower right")
    return figure


@styled
def blockage_figure(found) -> Figure:
    """How long obstructed links stay so: share of episodes that last longer."""
    figure, axes = new_figure(11.0, 2.8, len(CLASSES), sharey=True)
    for k, (ax, name) in enumerate(zip(axes, CLASSES)):
        for model in ("abstract", "raycast"):
            seconds = found["seconds"][(found["kind"] == k) & (found["is_planar"] == (model == "abstract"))]
            if len(seconds):
                ax.ecdf(seconds, complementary=True, color=COLOURS[model], label=f"{model} ({len(seconds):,})")
        ax.set(title=name, xlabel="seconds", xscale="log", yscale="log")
        _legend(ax)
    axes[0].set_ylabel("episodes that last longer")
    return figure


def _legend(ax, **where):
    """A legend, where there is anything to name."""
    if ax.get_legend_handles_labels()[0]:
        ax.legend(frameon=False, fontsize=7, **where)


@styled
def latency_figure(results) -> Figure:
    """Share of messages delivered within a time since they were queued, by route and model."""
    figure, axes = new_figure(10.0, 2.8, len(ROUTES), sharey=True)
    for ax, route in zip(axes, ROUTES):
        for label in (*MODELS, SHUFFLED):
            ax.step(
                np.arange(LONGEST + 1), latency_curves(results[label], route), where="post", color=COLOURS[label], label=label
            )
        ax.set(title=route, xlabel="seconds since queued", xlim=(0, 35), ylim=(0, 1))
    axes[0].set_ylabel("messages delivered")
    axes[-1].legend(frameon=False, loc="lower right", fontsize=7)
    return figure


@styled
def age_figure(results) -> Figure:
    """Age of information over missions: of peers' reports at robots, of robots' reports at the station."""
    figure, axes = new_figure(10.0, 2.8, 3)
    for ax, (name, title) in zip(axes, (("peer", "peers' reports at robots"), ("station", "robots' reports at the station"))):
        for label in (*MODELS, SHUFFLED):
            ax.ecdf(column(results[label], f"{name}_age_mean"), color=COLOURS[label], label=label)
        ax.set(title=title, xlabel="mean age in a mission (s)", ylabel="missions up to it", xlim=(0, None))
    axes[1].legend(frameon=False, fontsize=7)
    _draw_components(axes[2], results)
    return figure


def _draw_components(ax, results):
    for label in (*MODELS, SHUFFLED):
        lines = [record["components"] for record in results[label]]
        table = np.full((len(lines), max(map(len, lines))), np.nan)
        for row, line in zip(table, lines):
            row[: len(line)] = line
        ax.plot(5 * np.arange(table.shape[1]) / 60, np.nanmean(table, axis=0), color=COLOURS[label], lw=1)
    ax.set(title="connected components of the robots", xlabel="minutes", ylabel="mean over missions", ylim=(0, None))


@styled
def mission_figure(results) -> Figure:
    """TWCR of the same missions under both models, and paired differences to the abstract one."""
    figure, axes = new_figure(9.0, 3.4, 2)
    base, cast = column(results["abstract"], "twcr"), column(results["raycast"], "twcr")
    axes[0].plot([0, 1], [0, 1], color="#bbbbbb", lw=1)
    axes[0].scatter(base, cast, 10, color=COLOURS["raycast"], alpha=0.6)
    axes[0].set(xlabel="TWCR, abstract", ylabel="TWCR, ray cast", xlim=(0, 1), ylim=(0, 1), aspect="equal")
    labels = [label for label in (*MODELS, SHUFFLED) if label != "abstract"]
    gaps = [column(results[label], "twcr") - base for label in labels]
    parts = axes[1].violinplot(gaps, orientation="horizontal", showmeans=True, showextrema=False)
    for body, label in zip(parts["bodies"], labels):
        body.set_facecolor(COLOURS[label])
    axes[1].axvline(0, color="#bbbbbb", lw=1)
    axes[1].set(xlabel="TWCR, difference to abstract on the same mission", yticks=range(1, len(labels) + 1), yticklabels=labels)
    return figure


@styled
def sweep_figure(rows) -> Figure:
    """Paired differences of TWCR along the sweeps."""
    quantities = list(dict.fromkeys(row["quantity"] for row in rows))
    figure, axes = new_figure(10.0, 3.0, len(quantities), sharey=True)
    for ax, quantity in zip(axes, quantities):
        ours = [row for row in rows if row["quantity"] == quantity]
        x, y = [row["value"] for row in ours], np.array([row["difference"] for row in ours])
        spread = np.abs(np.array([[row["difference_low"], row["difference_high"]] for row in ours]).T - y)
        ax.axhline(0, color="#bbbbbb", lw=1)
        ax.errorbar(x, y, spread, fmt="o-", color=COLOURS["raycast"], capsize=3, ms=4)
        ax.set(xlabel=quantity)
    axes[0].set_ylabel("TWCR, difference to own value")
    return figure
