"""The link budget's formulas against figures, exact solutions and differential equations."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.special import erfc, fresnel

from commhg_mj.base import elementary_functions as elementary
from commhg_mj.radio import losses as budget
from commhg_mj.radio.link_models import snr_of_delivery

UNION = {5: 36, 6: 211, 7: 1404, 8: 11633, 9: 77433, 10: 502690, 11: 3322763, 12: 21292910, 13: 134365911}


def error_rate(snr, size):
    """1 - (1 - Pe)^bits with every power of D written out, in extended precision."""
    p = np.longdouble(0.5 * erfc(10 ** (snr / 20)))
    d = np.sqrt(4 * p * (1 - p))
    bit_error = min(np.longdouble(1), sum(weight * d ** (2 * k) for k, weight in UNION.items()) / 2)
    return float(1 - (1 - bit_error) ** (8 * size))


def fresnel_loss(nu):
    """The exact loss [dB] over a half plane, from Fresnel's integrals (P.526, eq. 30)."""
    sine, cosine = fresnel(nu)
    return -20 * np.log10(np.hypot(1 - cosine - sine, cosine - sine) / 2)


FORMULAS = {  # name: (arguments of one call, the index and values of one that varies)
    "wavelength": ((2.4,), 0, [0.1, 2.4, 100.0]),
    "free_space_loss": ((300.0, 2.4), 0, [0.0, 0.5, 1.0, 2.0, 1e4]),
    "foliage_loss": ((30.0, 0.382, 36.0), 0, [0.0, 1.0, 1e4]),
    "weissberger_loss": ((30.0, 2.4), 0, [0.0, 10.0, 14.0, 15.0, 400.0]),
    "fresnel_parameter": ((0.1, 0.125), 0, [-1e9, -1.0, 0.0, 1.0]),
    "knife_edge_loss": ((0.5,), 0, [-np.inf, -1.0, -0.78, 0.0, 30.0]),
    "bullington_loss": ((6.0, 300.0), 0, [0.0, 6.0, 40.0]),
    "noise_power": ((20.0, 7.0), 0, [1.0, 20.0]),
    "packet_error": ((2.82, 192.0), 0, [-np.inf, -20.0, 2.0, 3.0, 40.0]),
}


@pytest.mark.parametrize("name", FORMULAS)
def test_formulas_take_numbers_and_arrays_alike(name):
    formula, (arguments, varies, values) = getattr(budget, name), FORMULAS[name]
    calls = [(*arguments[:varies], value, *arguments[varies + 1 :]) for value in values]
    together = formula(*arguments[:varies], np.array(values), *arguments[varies + 1 :])
    assert together.tolist() == [formula(*call) for call in calls] and np.isfinite(together).all()
    assert formula(*(int(np.ceil(value)) for value in arguments)) > -200, "whole numbers"


def test_every_formula_is_tested_for_arrays():
    formulas = {name for name, value in vars(budget).items() if hasattr(value, "match_signature")}
    assert set(FORMULAS) == formulas - set(vars(elementary))


def test_free_space_loss_has_the_figures_of_p525():
    assert budget.free_space_loss(np.array([150.0, 300.0, 600.0]), 2.4) == pytest.approx([83.57, 89.59, 95.61], abs=0.0051)
    # P.525 also gives the formula in other units: 32.4 + 20 log f/MHz + 20 log d/km
    metres, carrier = np.random.default_rng(0).uniform([1, 0.1], [5000, 100], (50, 2)).T
    in_practical_units = 32.4 + 20 * np.log10(1e3 * carrier) + 20 * np.log10(1e-3 * metres)
    np.testing.assert_allclose(budget.free_space_loss(metres, carrier), in_practical_units, atol=0.06)


def test_free_space_loss_stops_falling_near_the_antenna():
    assert budget.free_space_loss(0.0, 2.4) == budget.free_space_loss(1.0, 2.4) < budget.free_space_loss(1.01, 2.4)


def test_noise_is_thermal_noise_in_the_bandwidth():
    assert budget.noise_power(20.0, 7.0) == pytest.approx(-93.99, abs=0.005)
    boltzmann, kelvin, hertz = 1.380649e-23, 290.0, 20e6
    assert budget.noise_power(20.0, 0.0) == pytest.approx(10 * np.log10(boltzmann * kelvin * hertz / 1e-3), abs=0.03)


def test_knife_edge_is_the_half_plane_of_fresnels_integrals():
    """P.526's approximation: never farther than an eighth of a dB from the exact loss, and exact far in the shadow."""
    nu = np.linspace(-0.78, 30, 4000)
    np.testing.assert_allclose(budget.knife_edge_loss(nu), fresnel_loss(nu), atol=0.125)
    assert budget.knife_edge_loss(0.0) == pytest.approx(20 * np.log10(2), abs=0.02), "half the field: 6.02 dB"
    deep = np.geomspace(1e2, 1e5, 20)
    np.testing.assert_allclose(budget.knife_edge_loss(deep), 20 * np.log10(np.sqrt(2) * np.pi * deep), atol=0.13)


def test_knife_edge_neglects_the_ripples_of_an_open_way():
    nu = np.linspace(-20, -0.78, 4000)
    assert not budget.knife_edge_loss(nu).any()
    assert np.abs(fresnel_loss(nu)).max() < 1.4, "what is neglected"
    assert budget.knife_edge_loss(-0.7799) == pytest.approx(0, abs=0.02), "no step where it begins"


@pytest.mark.parametrize("heights", [(0.5, 40, 60), (-1.0, 100, 20), (12.0, 7, 300)])
def test_fresnel_parameter_counts_half_waves_of_detour(heights):
    """nu² = 4 detour / wavelength for small heights: what nu means."""
    above, d1, d2 = heights
    wavelength = budget.wavelength(2.4)
    nu = budget.fresnel_parameter(1e-3 * above * np.sqrt(1 / d1 + 1 / d2), wavelength)
    detour = sum(np.hypot(np.longdouble(d), 1e-3 * above) - d for d in (d1, d2))
    assert nu == pytest.approx(float(np.sign(above) * np.sqrt(4 * detour / wavelength)), rel=1e-4)


def test_bullingtons_correction_is_p526s():
    """L_uc = J(nu); L = L_uc + [1 - exp(-L_uc / 6)] (10 + 0.02 d), d in km."""
    for loss, kilometres in [(0.0, 1.0), (3.0, 0.25), (6.0, 100.0), (30.0, 40.0)]:
        written_out = loss + (1 - 1 / np.e ** (loss / 6)) * (10 + 0.02 * kilometres)
        assert budget.bullington_loss(loss, 1000 * kilometres) == pytest.approx(written_out, rel=1e-12)
    assert budget.bullington_loss(6.0, 100e3) == pytest.approx(6 + 0.632121 * 12, abs=1e-5)


@pytest.mark.parametrize("rate, limit", [(0.382, 36.0), (0.04, 9.4), (10.0, 0.1)])
def test_foliage_loss_solves_its_differential_equation(rate, limit):
    """Each further metre loses `rate`, less and less of it as the loss nears its limit: dA/dd = rate (1 - A / limit)."""
    metres = np.array([0.0, 0.5, 3.0, 14.0, 30.0, 100.0, 400.0])
    way = solve_ivp(lambda _, loss: rate * (1 - loss / limit), (0, 400), [0.0], "LSODA", metres, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(budget.foliage_loss(metres, rate, limit), way.y[0], atol=1e-6)


def test_foliage_loss_tends_to_its_limit():
    assert budget.foliage_loss(1e9, 0.382, 36.0) == 36.0
    assert budget.foliage_loss(1e9, 0.0, 36.0) == 0.0


def test_weissbergers_branches():
    assert budget.weissberger_loss(10.0, 1.0) == pytest.approx(4.5)
    assert budget.weissberger_loss(100.0, 1.0) == pytest.approx(10 ** (np.log10(1.33) + 0.588 * 2))
    near, far = budget.weissberger_loss(np.array([14.0, np.nextafter(14.0, 15.0)]), 2.4)
    assert near != far and far == pytest.approx(near, rel=0.005), "they meet within half a per cent"
    assert budget.weissberger_loss(50.0, 8.0) == pytest.approx(8**0.284 * budget.weissberger_loss(50.0, 1.0))


def test_packet_error_is_the_formula_written_out():
    for size in (1, 24, 160, 192, 1500):
        for snr in np.linspace(-6, 8, 57):
            assert budget.packet_error(snr, size) == pytest.approx(error_rate(snr, size), rel=1e-9, abs=1e-15)


def test_packet_error_has_its_waterfall_where_the_design_says():
    assert snr_of_delivery(0.5) == pytest.approx(2.82, abs=0.005)
    assert error_rate(2.82, 192) == pytest.approx(0.5, abs=0.005)
    assert error_rate(snr_of_delivery(0.95), 192) == pytest.approx(0.05, abs=1e-9)


snrs, sizes = st.floats(-30, 40), st.floats(1, 65535)


@given(snrs, snrs, sizes, sizes)
def test_packet_error_is_a_share_that_falls_with_snr_and_rises_with_size(snr, other, size, longer):
    (snr, other), (size, longer) = sorted((snr, other)), sorted((size, longer))
    assert 0 <= budget.packet_error(other, size) <= budget.packet_error(snr, size) <= budget.packet_error(snr, longer) <= 1


def test_packet_error_tends_to_everything_and_nothing():
    assert budget.packet_error(np.array([-np.inf, -300.0, -10.0]), 1).tolist() == [1, 1, 1]
    assert budget.packet_error(np.array([60.0, 300.0, np.inf]), 65535).tolist() == [0, 0, 0]
    assert 0 < budget.packet_error(9.0, 192) < 1e-9, "small losses are not rounded away"
