"""One link under both models, and fitted decay lengths."""

import numpy as np
from rich.table import Table

from ...planning.decay_fit import Fit
from ...planning.section import MODELS, LinkView
from ...radio import losses as budget
from ...radio.link_models import system_loss
from . import page_table


def link_table(link: LinkView) -> Table:
    """Both models side by side."""
    (start, end), planar, rays = link.places, link.seen["abstract"], link.seen["raycast"]
    kind = "telemetry" if start.is_station or end.is_station else "broadcast"
    table = Table("", *MODELS, title=f"{start.name} to {end.name}, {kind} of {link.size} B", title_justify="left")
    loss = budget.packet_error(rays["snr"], float(link.size))
    clear = ["a mountain stands in the ray" if rays["is_blocked"] else "in canopies" if rays["forest"] else "yes"]
    ranges = [float(link.links[model].rules["range"]) for model in MODELS]
    is_robots = kind == "broadcast"
    for row in (
        ("way (m)", f"{planar['metres']:.1f} in plan", f"{rays['metres']:.1f}"),
        ("range (m)", *(f"{r:g}" if is_robots and np.isfinite(r) else "none" for r in ranges)),
        ("line of sight", "yes" if planar["forest"] + planar["mountain"] == 0 else "over footprints", *clear),
        ("metres in forest", f"{planar['forest']:.1f}", f"{rays['forest']:.1f} of canopy"),
        ("metres in mountains", f"{planar['mountain']:.1f}", ""),
        ("dominant edge", "", _edge(rays)),
        ("free-space loss (dB)", "", _decibel(rays["free_space"])),
        ("foliage loss (dB)", "", _decibel(rays["foliage"])),
        ("diffraction loss (dB)", "", _decibel(rays["diffraction"])),
        ("system loss (dB)", "", _decibel(system_loss(link.world.scenario, link.limitation))),
        ("shadowing (dB)", "", _decibel(rays["shadowing"])),
        ("SNR (dB)", "", _decibel(rays["snr"])),
        ("packet error", "", f"{loss:.4f}" if np.isfinite(loss) else ""),
        ("terrain and range let pass", *(f"{link.seen[m]['passing']:.4f}" for m in MODELS)),
        ("delivered in time", *(f"{link.seen[m]['on_time']:.4f}" for m in MODELS)),
        ("delivered late", *(f"{link.seen[m]['late']:.4f}" for m in MODELS)),
        ("lost", *(f"{1 - link.seen[m]['on_time'] - link.seen[m]['late']:.4f}" for m in MODELS)),
    ):  # fmt: skip
        table.add_row(*row)
    return table


def _decibel(value):
    return f"{value:.2f}" if np.isfinite(value) else ""


def _edge(rays):
    if not np.isfinite(rays["nu"]):
        return "none"
    side = "above" if rays["edge_height"] > 0 else "below"
    way = rays["edge_at"] * rays["metres"]
    return f"{abs(rays['edge_height']):.1f} m {side} the ray, {way:.0f} m along, nu {rays['nu']:.2f}"


def fit_table(fits: list[Fit]) -> Table:
    """The fields of abstract-fit, as scenarios take them."""
    heads = "scenario", "radio.fitted_forest_decay (m)", "radio.fitted_mountain_decay (m)", "links"
    table = page_table(*heads, title="abstract-fit, by maximum likelihood")
    table.add_column("log-likelihood a link: own, fitted")
    for one in fits:
        likelihood = f"{one.own_log_likelihood:.4f}, {one.log_likelihood:.4f}"
        table.add_row(one.scenario, f"{one.forest_decay:.1f}", f"{one.mountain_decay:.1f}", f"{one.links:,}", likelihood)
    return table
