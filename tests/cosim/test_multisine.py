from __future__ import annotations

import numpy as np
import pytest

from attitude_fmu.cosim.multisine import is_settling, measured, multisine, odd_bins, schroeder_phases, without_drift

LENGTH = 200
BINS = np.array([1, 3, 5, 9, 15, 31, 63])


def waves(realisations: int, chance: np.random.Generator) -> np.ndarray:
    return np.array([multisine(LENGTH, BINS, chance.uniform(0.0, 2.0 * np.pi, len(BINS))) for _ in range(realisations)])


def test_a_multisine_has_equal_lines_where_they_are_wanted_and_none_elsewhere() -> None:
    wave = multisine(LENGTH, BINS, schroeder_phases(len(BINS)))
    sizes = np.abs(np.fft.rfft(wave))
    assert sizes[BINS] == pytest.approx(sizes[BINS[0]], rel=1e-12)
    assert np.max(np.delete(sizes, BINS)) < 1e-12 * sizes[1]
    assert np.max(np.abs(wave)) == pytest.approx(1.0)


def test_schroeders_phases_keep_the_peak_low() -> None:
    bins = np.arange(1, 41)
    wave, peaked = (multisine(LENGTH, bins, phases) for phases in (schroeder_phases(40), np.zeros(40)))
    crest, worst = (1.0 / np.sqrt(np.mean(one**2)) for one in (wave, peaked))
    assert worst == pytest.approx(np.sqrt(2.0 * 40))  # all at once: n over sqrt(n/2)
    assert crest < 2.0


def test_lines_are_odd_and_below_half_the_sampling_rate() -> None:
    bins = odd_bins(1000, 1, 1000, 40)
    assert np.all(bins % 2 == 1)
    assert bins[0] == 1
    assert 450 < bins[-1] < 500
    assert np.all(np.diff(bins) > 0)


def test_a_ramp_is_taken_out_exactly() -> None:
    wave = np.tile(multisine(LENGTH, BINS, np.zeros(len(BINS))), 3)
    ramp = 0.37 * np.arange(3 * LENGTH)
    found = without_drift((wave + ramp).reshape(3, LENGTH, 1))
    assert found == pytest.approx(np.broadcast_to(found[0], found.shape), abs=1e-10)
    assert found[0, :, 0] - found[0, 0, 0] == pytest.approx(wave[:LENGTH] - wave[0], abs=1e-10)


def test_the_response_is_what_the_lines_were_multiplied_by() -> None:
    given = np.repeat(waves(2, np.random.default_rng(1))[:, None], 3, axis=1)
    shown = np.stack((2.0 * given, np.roll(given, 4, axis=-1)), axis=-1)
    found = measured(given, shown, BINS)
    assert found.response[:, 0] == pytest.approx(2.0, abs=1e-12)
    assert found.response[:, 1] == pytest.approx(np.exp(-2j * np.pi * BINS * 4 / LENGTH), abs=1e-12)
    assert found.coherence == pytest.approx(1.0)
    assert np.max(found.variance) < 1e-24


def test_the_variance_is_that_of_the_error() -> None:
    # 400 trials of 2 x 4 periods: errors over the stated deviation have a mean square of 1; the stated variance has 12
    # degrees of freedom or, the larger of two being taken, a little bias upwards; 2800 ratios scatter by 0.03
    chance = np.random.default_rng(2)
    ratios = []
    for _ in range(400):
        given = np.repeat(waves(2, chance)[:, None], 4, axis=1)
        shown = (given + 0.1 * chance.normal(size=given.shape))[..., None]
        found = measured(given, shown, BINS)
        ratios.append((np.abs(found.response - 1.0) ** 2).mean() / found.variance.mean())
    assert 0.6 < np.mean(ratios) < 1.05


def test_gain_and_phase_have_half_of_the_variance_each() -> None:
    # 300 trials of 8 periods at 7 lines, variance by 14 degrees of freedom: means of 2100 squares, each within 1 of the
    # F distribution's 1.17, scatter by 0.04; four times that
    chance = np.random.default_rng(6)
    gain, phase = [], []
    for _ in range(300):
        given = np.repeat(waves(1, chance)[:, None], 8, axis=1)
        found = measured(given, (given + 0.02 * chance.normal(size=given.shape))[..., None], BINS)
        gain.append((np.abs(found.response) - 1.0) ** 2 / (0.5 * found.variance))
        phase.append(np.angle(found.response) ** 2 / (0.5 * found.variance))
    assert np.mean(gain) == pytest.approx(14.0 / 12.0, abs=0.16)
    assert np.mean(phase) == pytest.approx(14.0 / 12.0, abs=0.16)


def test_coherence_is_the_share_of_the_output_that_follows_the_input() -> None:
    # power of a line: signal 1, noise 1; 8000 periods: the estimate scatters by about sqrt(2 g (1-g)^2/8000) = 0.006
    chance = np.random.default_rng(3)
    given = np.repeat(waves(1, chance)[:, None], 8000, axis=1)
    size = np.abs(np.fft.rfft(given[0, 0])[1])
    noise = chance.normal(size=given.shape) * size / np.sqrt(LENGTH)
    found = measured(given, (given + noise)[..., None], BINS)
    assert found.coherence == pytest.approx(0.5, abs=0.03)


def test_coherence_of_noise_alone_is_one_over_the_number_of_records() -> None:
    # of N records it follows a Beta distribution with 1 and N - 1: mean 1/N, deviation about 1/N; 2100 of them
    chance = np.random.default_rng(7)
    found = []
    for _ in range(300):
        given = np.repeat(waves(2, chance)[:, None], 3, axis=1)
        found.append(measured(given, chance.normal(size=(*given.shape, 1)), BINS).coherence)
    assert np.mean(found) == pytest.approx(1.0 / 6.0, abs=4.0 / 6.0 / np.sqrt(2100))


def test_coherence_shows_nonlinearity_where_there_are_realisations() -> None:
    chance = np.random.default_rng(8)
    for realisations, low, high in ((1, 1.0 - 1e-12, 1.0 + 1e-12), (4, 0.0, 0.999)):
        given = np.repeat(waves(realisations, chance)[:, None], 3, axis=1)
        found = measured(given, (given + given**3)[..., None], BINS)
        assert low <= np.min(found.coherence) <= high


def test_even_and_odd_nonlinearity_are_told_apart_from_noise() -> None:
    given = np.repeat(waves(3, np.random.default_rng(4))[:, None], 2, axis=1)
    shown = np.stack((given + 0.1 * given**2, given + 0.1 * given**3, given), axis=-1)
    found = measured(given, shown, BINS)
    assert found.even[0] > 0.01
    assert found.odd[1] > 0.005
    assert max(found.odd[0], found.even[1], found.even[2], found.odd[2], *found.noise) < 1e-9


def test_one_period_tells_nothing_of_its_errors() -> None:
    given = waves(1, np.random.default_rng(5))[:, None]
    found = measured(given, given[..., None], BINS)
    assert np.all(np.isnan(found.variance))
    assert np.all(np.isnan(found.coherence))
    assert np.all(np.isnan(found.change))


@pytest.mark.parametrize("periods", [3, 4, 8])
def test_a_transient_is_told_from_noise(periods: int) -> None:
    # noise is taken for a transient less than once in 100 times: 3 deviations of a mean that is nearly normal
    chance = np.random.default_rng(9)
    time = np.arange(periods * LENGTH).reshape(periods, LENGTH) / LENGTH
    told = []
    for decay in (None, 0.1, 1.0):  # turns of a period in which it dies to 1/e
        count = 0
        for _ in range(300):
            given = np.repeat(waves(2, chance)[:, None], periods, axis=1)
            shown = given + 0.01 * chance.normal(size=given.shape)
            if decay is not None:
                shown += chance.choice((-1.0, 1.0), size=(2, 1, 1)) * np.exp(-decay * time)
            found = measured(given, shown[..., None], BINS)
            count += is_settling(found.change_share[:, 0], 2, periods)
        told.append(count)
    assert told[0] < 9
    assert told[2] > 290


def test_rounding_is_no_change() -> None:
    given = np.repeat(waves(2, np.random.default_rng(10))[:, None], 3, axis=1)
    shown = 1.0 + 1e-15 * np.random.default_rng(11).normal(size=(*given.shape, 1))
    assert not np.any(measured(given, shown, BINS).change)
