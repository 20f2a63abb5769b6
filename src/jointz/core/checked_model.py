"""Base of the models of edited files: all inconsistencies are reported at once, each at its key."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Self

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import InitErrorDetails, PydanticCustomError

INCONSISTENT = "inconsistent"
#: Of edited files: "17" is no torque and true is no count; lists of TOML stand for tuples.
STRICT = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


@dataclass(frozen=True, slots=True)
class Problem:
    """A value of a file that is wrong."""

    # path of the key, from the model that found it; entries of lists count from 0
    key: tuple[str | int, ...]
    message: str  # expected value, found value, and remedy


def place_of(key: tuple[str | int, ...]) -> str:
    """Return the path of a key as people read it: entries of lists count from 1."""
    return "".join(f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in key)[1:]


Check = Callable[[], Iterable[Problem]]


class CheckedModel(BaseModel):
    """A strict, frozen model whose checks name the key that each problem belongs to."""

    model_config = STRICT

    def checks(self) -> tuple[Check, ...]:
        """Return the checks of relations between fields; each runs without the others."""
        return ()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        details = [
            InitErrorDetails(
                type=PydanticCustomError(INCONSISTENT, "{told}", {"told": problem.message}),
                loc=problem.key,
                input=self,
            )
            for check in self.checks()
            for problem in check()
        ]
        if details:
            raise ValidationError.from_exception_data(type(self).__name__, details)
        return self
