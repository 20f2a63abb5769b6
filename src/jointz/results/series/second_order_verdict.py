"""Result of testing a joint's residual for what a second-order joint does not have."""

from dataclasses import dataclass

from jointz.results.base import Result


@dataclass(frozen=True, slots=True, repr=False)
class SecondOrderCheck(Result):
    """Tests of the residual of K, B, J for a stretch reflex and for further dynamics."""

    # ``none``; ``reflex``: torque that follows rectified velocity after a latency;
    # ``higher_order``: linear dynamics above second order, or a lag; ``not_tested``: the record is
    # too short, or there is no fit
    finding: str = "not_tested"
    reflex_p_value: float | None = None  # of the test for a reflex, at the level 0.005
    # of the test for further linear dynamics, at the level 0.005
    higher_order_p_value: float | None = None
    # s: lag of the torque behind the angle, if a lag alone explains the finding ``higher_order``
    lag_s: float | None = None

    @property
    def fails(self) -> bool:
        """True if the residual refutes a second-order joint."""
        return self.finding in ("reflex", "higher_order")

    def sentence(self) -> str:
        """Return what was found, for a summary."""
        reflex, order = (
            "" if p is None else f" (p {p:.2g})"
            for p in (self.reflex_p_value, self.higher_order_p_value)
        )
        if self.finding == "reflex":
            return f"the residual contains a stretch reflex{reflex}"
        if self.finding == "higher_order":
            return f"the residual shows dynamics beyond a second-order joint{order}"
        if self.finding == "none":
            return (
                f"the residual shows no stretch reflex{reflex} and no higher order{order} that "
                "moves K, B or J out of their intervals"
            )
        return "the residual was not tested for a stretch reflex or a higher order"

    def advice(self, model: str = "kbj") -> str:
        """Return what a refuted second-order joint means and what to do."""
        if self.finding == "reflex":
            return (
                "K, B and J of a second-order joint include reflex torque and are not intrinsic. "
                "Use --model reflex, which separates the two"
            )
        if self.lag_s is not None:
            return self._lag_advice(self.lag_s)
        response = (
            "The frequency response shows a soft attachment"
            if model == "frf"
            else "Use --model frf, which shows a soft attachment"
        )
        return (
            "K, B and J of a second-order joint depend on the perturbation, because of a soft "
            f"attachment, friction or a reflex. {response}; use --model reflex to test for a reflex"
        )

    @staticmethod
    def _lag_advice(lag_s: float) -> str:
        late, other = ("torque", "angle") if lag_s > 0.0 else ("angle", "torque")
        size = f"{1e3 * abs(lag_s):.2g}"
        return (
            f"the {late} is recorded {size} ms later than the {other}, which biases K, B and J and "
            f"explains the residual. Set {late}_lag_s = {1e-3 * float(size):g} under [calibration] "
            f"in a study, or shift the {late} column {size} ms earlier before identify; then run "
            "again"
        )
