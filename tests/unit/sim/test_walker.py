"""The simulated walkers: do they do what their settings and their truth say?"""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jointz.core.errors import DataError
from jointz.core.gait_phases import TIMING_POINTS
from jointz.sim.joint import knee_angle, respond
from jointz.sim.walker import WalkerSettings, draw_participants, simulate_recording

EXACT = WalkerSettings.exact()
REST_S = 0.25 + 0.006 + 30 * 0.012  # pulse, delay and what the actuator takes to rest


def perturbed(participant, *, settings=EXACT, seed=1, n=3):
    return simulate_recording(
        participant,
        condition="perturbed",
        settings=settings,
        rng=np.random.default_rng(seed),
        n_pulses_per_point=n,
    )


def unperturbed(participant, *, settings=EXACT, seed=1, n=40):
    return simulate_recording(
        participant,
        condition="unperturbed",
        settings=settings,
        rng=np.random.default_rng(seed),
        n_strides=n,
    )


@pytest.fixture(scope="module")
def people():
    return draw_participants(200, np.random.default_rng(7))


@pytest.fixture(scope="module")
def long_walk(people):
    return perturbed(people[0], settings=WalkerSettings(), n=50)


def stride_of(onset_s, strikes):
    return int(np.searchsorted(strikes, onset_s, side="right")) - 1


def last_three_mean(strikes, k):
    return (strikes[k] - strikes[k - 3]) / 3


class TestPeople:
    def test_have_the_means_and_the_spread_of_the_population(self, people):
        for name, mean in zip(TIMING_POINTS, (2.0, 0.65, 1.15, 1.15, 0.32, 0.38), strict=True):
            values = np.array([p.stiffness_per_mass[name] for p in people])
            # 200 people: the mean is known to 1.8 %, the coefficient of variation to about 8 %.
            assert values.mean() == pytest.approx(mean, rel=0.06)
            assert values.std() / values.mean() == pytest.approx(0.25, rel=0.25)
            assert np.log(values).std() == pytest.approx(0.246, rel=0.2)
        for name, mean in zip(TIMING_POINTS, (0.035, 0.04, 0.05, 0.03, 0.036, 0.027), strict=True):
            values = np.array([p.damping_per_mass[name] for p in people])
            assert values.mean() == pytest.approx(mean, rel=0.06)

    def test_have_bodies_within_the_stated_range(self, people):
        mass = np.array([p.mass_kg for p in people])
        assert mass.mean() == pytest.approx(73.0, abs=2.5)
        assert 52.0 <= mass.min() < mass.max() <= 100.0
        assert all(0.03 <= p.inertia <= 0.07 for p in people)
        assert all(1.0 <= p.stride_time_s <= 1.2 for p in people)
        assert [p.id for p in people[:2]] == ["S01", "S02"]

    def test_differ_and_come_back_from_the_same_seed(self, people):
        again = draw_participants(3, np.random.default_rng(7))
        assert again == people[:3]
        assert len({p.inertia for p in people}) == len(people)


class TestStrides:
    def test_vary_as_much_as_the_settings_say(self, people):
        walk = unperturbed(people[0], settings=WalkerSettings(), n=1500)
        strides = np.diff(walk.heel_strike_s)
        assert strides.size == 1500
        # 1500 strides: sd known to 1.8 %; the tails are clipped at 3 sd.
        assert strides.mean() == pytest.approx(people[0].stride_time_s, rel=0.003)
        assert strides.std() / strides.mean() == pytest.approx(0.025, rel=0.06)

    def test_change_in_amplitude_and_offset_as_much_as_the_settings_say(self, people):
        settings = replace(EXACT, amplitude_sd=0.03, offset_sd_rad=np.radians(1.0))
        walk = unperturbed(people[0], settings=settings, n=1500)
        at = np.searchsorted(walk.time, walk.heel_strike_s[:-1])
        design = np.column_stack([knee_angle(np.array([0.0, 0.72])), np.ones(2)])
        swing = np.searchsorted(
            walk.time, walk.heel_strike_s[:-1] + 0.72 * np.diff(walk.heel_strike_s)
        )
        amplitude, _ = np.linalg.solve(design, np.array([walk.angle[at], walk.angle[swing]]))
        # Interpolation between strikes and the offset's own change blur both a little.
        assert amplitude.std() == pytest.approx(0.03, rel=0.25)
        at_strikes = walk.angle[at] - knee_angle(np.zeros(1))
        assert at_strikes.std() == pytest.approx(np.radians(1.0), rel=0.1)
        assert np.corrcoef(at_strikes[1:], at_strikes[:-1])[0, 1] == pytest.approx(0.5, abs=0.08)

    def test_begin_where_contact_rises_and_swing_begins_at_62_percent(self, long_walk):
        change = np.diff(long_walk.contact)
        rises = long_walk.time[1:][change == 1.0]
        falls = long_walk.time[1:][change == -1.0]
        np.testing.assert_array_equal(rises, long_walk.heel_strike_s)
        length = np.diff(rises)
        np.testing.assert_allclose(falls[: length.size] - rises[:-1], 0.62 * length, atol=1.1e-3)
        assert set(np.unique(long_walk.contact)) == {0.0, 1.0}


class TestPulses:
    def test_come_as_often_as_asked_at_each_point(self, long_walk):
        counts = Counter(p.timing_point for p in long_walk.pulses)
        assert counts == dict.fromkeys(TIMING_POINTS, 50)

    def test_come_every_three_to_seven_strides(self, long_walk):
        strikes = long_walk.heel_strike_s
        gaps = np.diff([stride_of(p.onset_s, strikes) for p in long_walk.pulses])
        assert set(gaps) == {3, 4, 5, 6, 7}

    def test_fire_from_the_mean_of_the_last_three_strides(self, long_walk):
        strikes = long_walk.heel_strike_s
        for pulse in long_walk.pulses:
            k = stride_of(pulse.onset_s, strikes)
            due = strikes[k] + TIMING_POINTS[pulse.timing_point] / 100 * last_three_mean(strikes, k)
            assert -1e-9 <= pulse.onset_s - due < 1e-3

    def test_are_commanded_for_250_ms_from_their_onset(self, long_walk):
        rises = np.flatnonzero(np.diff(long_walk.command) > 0) + 1
        falls = np.flatnonzero(np.diff(long_walk.command) < 0) + 1
        np.testing.assert_array_equal(long_walk.time[rises], [p.onset_s for p in long_walk.pulses])
        assert set(falls - rises) == {250}
        assert set(np.unique(long_walk.command)) == {0.0, 17.0}

    def test_reach_the_joint_after_the_delay_and_the_lag_of_the_actuator(self, people):
        walk = perturbed(people[0])
        for pulse in walk.pulses:
            since = walk.time - pulse.onset_s
            during = (since > -0.01) & (since < 0.255)
            want = 17.0 * -np.expm1(-np.maximum(since[during] - 0.006, 0.0) / 0.012)
            np.testing.assert_allclose(walk.torque[during], want, rtol=0, atol=1e-9)


class TestExactSettings:
    def test_leave_no_torque_outside_pulses(self, people):
        walk = perturbed(people[0])
        outside = np.ones(walk.time.size, dtype=bool)
        for pulse in walk.pulses:
            outside &= (walk.time < pulse.onset_s) | (walk.time > pulse.onset_s + REST_S)
        assert outside.mean() > 0.5
        assert not walk.torque[outside].any()
        assert not unperturbed(people[0]).torque.any()

    def test_leave_the_mean_knee_before_the_first_pulse(self, people):
        walk = perturbed(people[0])
        stride_s = round(people[0].stride_time_s, 3)
        cycles = (walk.time - walk.heel_strike_s[0]) / stride_s
        before = walk.time <= walk.pulses[0].onset_s
        np.testing.assert_allclose(
            walk.angle[before], knee_angle(cycles[before]), rtol=0, atol=1e-9
        )
        whole = unperturbed(people[0])
        cycles = (whole.time - whole.heel_strike_s[0]) / stride_s
        np.testing.assert_allclose(whole.angle, knee_angle(cycles), rtol=0, atol=1e-9)

    def test_give_the_response_that_solve_ivp_gives(self, people):
        person, walk = people[3], perturbed(people[3])
        cycles = (walk.time - walk.heel_strike_s[0]) / round(person.stride_time_s, 3)
        deviation = walk.angle - knee_angle(cycles)

        def torque(t):
            return np.interp(t, walk.time, walk.torque)

        for pulse in walk.pulses[:6]:
            K = person.stiffness_per_mass[pulse.timing_point] * person.mass_kg
            B = person.damping_per_mass[pulse.timing_point] * person.mass_kg
            span = (walk.time >= pulse.onset_s) & (walk.time <= pulse.onset_s + 0.1)
            solution = solve_ivp(
                lambda t, y, K=K, B=B: (
                    y[1],
                    (torque(t) - B * y[1] - K * y[0]) / person.inertia,
                ),
                walk.time[span][[0, -1]],
                (0.0, 0.0),
                t_eval=walk.time[span],
                max_step=0.5e-3,
                rtol=1e-10,
                atol=1e-12,
            )
            # What the pulse before left over after three strides is below 1e-9 rad.
            np.testing.assert_allclose(deviation[span], solution.y[0], rtol=0, atol=3e-6)


class TestTruth:
    def test_is_one_stiffness_and_damping_for_12_percent_of_a_stride_after_every_onset(
        self, people
    ):
        # Irregular strides, no noise: with and without torque differ by the response alone.
        person = replace(people[1], stride_time_s=1.0)
        settings = replace(EXACT, stride_sd=0.035, amplitude_sd=0.03)
        walk = perturbed(person, settings=settings, n=25)
        quiet = perturbed(person, settings=replace(settings, pulse_nm=0.0), n=25)
        response = walk.angle - quiet.angle
        for pulse in walk.pulses:
            first = np.searchsorted(walk.time, pulse.onset_s)
            window = slice(first, first + 120)
            want, _ = respond(
                walk.torque[window],
                person.stiffness_per_mass[pulse.timing_point] * person.mass_kg,
                person.damping_per_mass[pulse.timing_point] * person.mass_kg,
                person.inertia,
                rate_hz=settings.rate_hz,
            )
            np.testing.assert_allclose(response[window], want, rtol=0, atol=1e-9)


class TestMeasurement:
    def test_noise_is_as_large_as_the_settings_say(self, people):
        noisy = unperturbed(
            people[0],
            settings=replace(
                EXACT,
                angle_white_sd_rad=np.radians(0.3),
                angle_coloured_sd_rad=np.radians(0.15),
                torque_noise_sd_nm=0.25,
            ),
            n=600,
        )
        clean = unperturbed(people[0], n=600)
        noise = np.degrees(noisy.angle - clean.angle)
        assert np.diff(noise).std() == pytest.approx(0.3 * np.sqrt(2), rel=0.02)
        slow = noise[: noise.size // 50 * 50].reshape(-1, 50).mean(axis=1)
        # White noise leaves 0.3 / sqrt(50); the coloured part keeps 0.92 of its sd over 50 ms.
        assert slow.std() == pytest.approx(np.hypot(0.15 * 0.92, 0.3 / np.sqrt(50)), rel=0.05)
        # 660 s hold about 1300 independent torque errors: their sd is known to 2 %.
        assert noisy.torque.std() == pytest.approx(0.25, rel=0.08)
        lag = round(0.25 * 1000)
        memory = np.corrcoef(noisy.torque[lag:], noisy.torque[:-lag])[0, 1]
        assert memory == pytest.approx(np.exp(-1), abs=0.08)

    def test_a_lag_shows_the_angle_late_and_nothing_else(self, people):
        prompt = perturbed(people[0], n=1)
        late = perturbed(people[0], settings=replace(EXACT, angle_lag_s=0.008), n=1)
        np.testing.assert_allclose(late.angle[8:], prompt.angle[:-8], rtol=0, atol=1e-9)
        np.testing.assert_array_equal(late.torque, prompt.torque)

    def test_a_perturbed_recording_is_shifted_by_its_condition(self, people):
        settings = replace(
            EXACT,
            pulse_nm=0.0,
            condition_offset_sd_rad=np.radians(1.5),
            condition_amplitude_sd=0.02,
            condition_phase_sd=0.005,
        )
        shifts = []
        for seed in range(60):
            walk = perturbed(people[0], settings=settings, seed=seed, n=1)
            cycles = (walk.time - walk.heel_strike_s[0]) / round(people[0].stride_time_s, 3)
            curve = knee_angle(cycles)
            slope = (knee_angle(cycles + 1e-4) - knee_angle(cycles - 1e-4)) / 2e-4
            design = np.column_stack([np.ones(curve.size), curve, slope])
            shifts.append(np.linalg.lstsq(design, walk.angle - curve, rcond=None)[0])
        offset, amplitude, phase = np.std(shifts, axis=0)
        # 60 seeds know an sd to 9 %.
        assert offset == pytest.approx(np.radians(1.5), rel=0.3)
        assert amplitude == pytest.approx(0.02, rel=0.3)
        assert phase == pytest.approx(0.005, rel=0.3)

    def test_the_same_seed_gives_the_same_recording_and_another_one_another(self, people):
        settings = WalkerSettings()
        one = perturbed(people[0], settings=settings, seed=5, n=1)
        same = perturbed(people[0], settings=settings, seed=5, n=1)
        other = perturbed(people[0], settings=settings, seed=6, n=1)
        for name in ("time", "angle", "torque", "command", "contact", "heel_strike_s"):
            np.testing.assert_array_equal(getattr(one, name), getattr(same, name))
        assert one.pulses == same.pulses
        assert one.pulses != other.pulses

    def test_different_people_give_different_recordings(self, people):
        one, two = (perturbed(p, seed=5, n=1) for p in people[:2])
        assert not np.array_equal(np.diff(one.heel_strike_s), np.diff(two.heel_strike_s))
        assert abs(one.angle.max() - two.angle.max()) > 1e-3


class TestRefusals:
    def test_an_unknown_condition_is_named(self, people):
        with pytest.raises(DataError, match="got 'resting'"):
            simulate_recording(people[0], condition="resting", rng=np.random.default_rng(0))

    def test_an_empty_recording_is_refused(self, people):
        with pytest.raises(DataError, match="at least one"):
            perturbed(people[0], n=0)
        with pytest.raises(DataError, match="at least one"):
            unperturbed(people[0], n=0)

    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            ({"stride_sd": 0.05}, r"stride_sd must lie in 0\.\.0\.035, got 0.05"),
            ({"actuator_time_constant_s": 0.0}, "must be positive"),
            ({"rate_hz": 0.0}, "must be positive"),
        ],
    )
    def test_settings_that_cannot_be_walked_are_refused(self, changes, message):
        with pytest.raises(DataError, match=message):
            WalkerSettings(**changes)
