"""A scenario's radio numbers under one link model and one limitation level, as kernels read them."""

from enum import IntEnum
from functools import cache

import numpy as np
from scipy.optimize import brentq

from ..base.arguments import one_of
from ..base.kernels import record
from ..base.registries import Registry
from ..scenarios import LIMITATIONS, Scenario
from . import losses as budget


class LinkModel(IntEnum):
    ABSTRACT = 0  # planar, the paper's
    ABSTRACT_FIT = 1  # the same with decay lengths fitted to the ray-cast model
    RAYCAST = 2  # through MuJoCo's world
    RAYCAST_SHUFFLED = 3  # control: every robot has another robot's ray-cast links
    PERFECT = 4  # free communication, for the omniscient reference
    CUSTOM = 5  # a user's own function, under a name of its own
    SILENT = 6  # no message is delivered: what a team does without any
    KNOWN = 7  # as perfect, and everybody's records are true in every second: nobody needs to be told


LINK_MODELS = {model.name.lower().replace("_", "-"): model for model in LinkModel if model != LinkModel.CUSTOM}  # built in
# Addresses of functions in this process (radio/custom.py):
OWN_MODELS = Registry("link model", "commhg_mj.link_models", beside=LINK_MODELS)
DEFAULT_LINKS = "raycast"  # of every command, interface and training: geometry first
IDEAL = (LinkModel.PERFECT, LinkModel.KNOWN)
RAY_MODELS = (LinkModel.RAYCAST, LinkModel.RAYCAST_SHUFFLED)

RADIO = record(
    link_model="i8",
    on_time="f8",  # share of packets in time over clear ground
    range="f8",  # m; robots hear each other no farther, inf: no cap
    forest_decay="f8",  # m, abstract
    mountain_decay="f8",
    exact_when_clear="i8",  # ray cast: nothing in between, nothing lost
    clear_snr="f8",  # dB, before losses: transmit power less system loss and noise
    frequency="f8",  # GHz
    wavelength="f8",  # m
    is_weissberger="i8",
    foliage_rate="f8",  # dB/m
    foliage_limit="f8",  # dB
    is_bullington="i8",
    shadowing="f8",  # dB
    shadowing_length="f8",  # m
    antenna=("f8", (2,)),  # m: a UAV's above the floor of flights, a UGV's above the ground (models/terrain.py)
    mast="f8",  # m above the ground
    share_at="i8",  # address of a user's own function, of use in its process alone; 0: a built-in model
)
LINK = record(  # one link as its model sees it; nan where the model knows no such thing, or of radios in one place
    metres="f8",  # way between the antennas, in three dimensions or in plan
    forest="f8",  # m of it inside forests: canopies, or footprints in plan
    mountain="f8",  # m in plan inside mountains' footprints
    is_blocked="f8",  # 1: a mountain stands in the ray
    nu="f8",  # diffraction parameter of the dominant edge, -inf: none
    edge_at="f8",  # share of the way from a to it
    edge_height="f8",  # m above the ray, -inf: none
    free_space="f8",  # dB, as all losses
    foliage="f8",
    diffraction="f8",
    shadowing="f8",
    snr="f8",  # dB
    passing="f8",  # share of packets that terrain lets pass; 0 beyond the range
    on_time="f8",  # share of messages in time
    late="f8",  # share of messages late
)
REFERENCE_SIZE = 192.0  # B: the packet that profiles are calibrated with
EDGE_DELIVERY = 0.95  # edge: a clear link at the range, by SNR alone


def find_link_model(name: str) -> LinkModel:
    """The link model of that name, built in or registered.

    Raises:
      ValueError: there is none.
    """
    if isinstance(name, str) and name in LINK_MODELS:
        return LINK_MODELS[name]
    OWN_MODELS.find(name, ", or register it in this process (commhg_mj.link_model)")
    return LinkModel.CUSTOM


def radio_rules(scenario: Scenario, links: str, limitation: str) -> np.void:
    """One RADIO record.

    Raises:
      ValueError: unknown link model or limitation; the message names it.
    """
    model = find_link_model(links)
    one_of("limitation", limitation, LIMITATIONS)
    level, transport, radio = LIMITATIONS.index(limitation), scenario.communication, scenario.radio
    decays = radio.fitted_forest_decay, radio.fitted_mountain_decay
    if model != LinkModel.ABSTRACT_FIT:
        decays = transport.forest_decay, transport.mountain_decay
    is_capped = radio.profile == "matched" if model in RAY_MODELS else model not in (*IDEAL, LinkModel.CUSTOM)
    rules = np.zeros(1, RADIO)[0]
    rules["link_model"] = model
    rules["on_time"] = 1.0 if model in IDEAL else 1.0 - transport.unavailable_or_delayed[level]
    rules["range"] = transport.range[level] * scenario.map_side if is_capped else np.inf
    rules["forest_decay"], rules["mountain_decay"] = decays
    rules["exact_when_clear"] = radio.profile == "matched"
    noise = budget.noise_of(radio.bandwidth, radio.noise_figure)
    rules["clear_snr"] = radio.transmit_power - noise - system_loss(scenario, limitation)
    rules["frequency"], rules["wavelength"] = radio.frequency, budget.wavelength_of(radio.frequency)
    rules["is_weissberger"], rules["is_bullington"] = radio.foliage == "weissberger", radio.diffraction == "bullington"
    for name in ("foliage_rate", "foliage_limit", "shadowing", "shadowing_length"):
        rules[name] = getattr(radio, name)
    rules["antenna"] = scenario.world.uav_height + radio.uav_antenna, radio.ugv_antenna
    rules["mast"] = scenario.world.mast_height
    rules["share_at"] = OWN_MODELS.get(links, 0)
    return rules


def system_loss(scenario: Scenario, limitation: str) -> float:
    """The loss [dB] that a profile adds to the radio's budget.

    matched: a clear link at the nominal range keeps `radio.margin` over the SNR that delivers half of the reference
    packets. The nominal range at every limitation level: it is one radio, and the level's cap comes on top.
    edge: a clear link at the level's range delivers EDGE_DELIVERY of them. radio: none.
    """
    radio, ranges = scenario.radio, scenario.communication.range
    if radio.profile == "radio":
        return 0.0
    if radio.profile == "matched":
        metres, snr = ranges[0] * scenario.map_side, snr_of_delivery(0.5) + radio.margin
    else:
        metres, snr = ranges[LIMITATIONS.index(limitation)] * scenario.map_side, snr_of_delivery(EDGE_DELIVERY)
    received = radio.transmit_power - budget.free_space_of(metres, radio.frequency)
    return float(received - budget.noise_of(radio.bandwidth, radio.noise_figure) - snr)


@cache
def snr_of_delivery(share: float) -> float:
    """The SNR [dB] at which that share of the reference packets is received."""
    return brentq(lambda snr: 1.0 - budget.error_of(snr, REFERENCE_SIZE) - share, -20.0, 40.0)
