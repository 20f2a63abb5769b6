"""The part of the report that says what error to expect in this study."""

from typing import Any

from jointz.core.gait_phases import ALL_POINTS
from jointz.report.wording import (
    DASH,
    format_count,
    format_signed,
    parameter_name,
    pretty_unit,
)
from jointz.results.certificate_result import PARAMETERS, Certificate, ExpectedError

#: Where more injections than this were undecided, the rest are no fair sample of intervals.
_MOSTLY_PCT = 50.0
_GIVEN_NAMES = {"lag_s": "lag in s"}
_SYMBOLS = dict(zip(PARAMETERS, "KBJ", strict=True))


def certificate_section(certificate: Certificate | None) -> dict[str, Any] | None:
    """Return the sentence and the table of a certificate, None where there is none."""
    if certificate is None or not certificate.errors:
        return None
    points = list(dict.fromkeys(row.timing_point for row in certificate.errors))
    points.sort(key=lambda name: name != ALL_POINTS)
    held = {(row.timing_point, row.parameter): row for row in certificate.errors}
    return {
        "sentence": _sentence(certificate),
        "note": _note(certificate),
        "symbols": [f"{_SYMBOLS[name]}: {parameter_name(name).lower()}" for name in PARAMETERS],
        "rows": [
            {
                "name": "all points" if point == ALL_POINTS else point,
                "cells": [_cell(held.get((point, name))) for name in PARAMETERS],
            }
            for point in points
        ],
    }


def _sentence(certificate: Certificate) -> str:
    rows = [row for row in certificate.errors if row.timing_point == ALL_POINTS]
    known = [row for row in rows if row.rmse is not None]
    if not known:
        return "In this study no injected response could be decided: expect no usable estimate."
    decided = [row for row in known if not _mostly_undecided(row)]
    sizes = ", ".join(f"{_size(row)} in {_SYMBOLS[row.parameter]}" for row in decided)
    held = ", ".join(f"{100 * (row.coverage or 0.0):.0f} %" for row in decided)
    told = [
        f"In this study expect errors of {sizes} (root mean square), and intervals that hold the "
        f"truth in {held} of cases."
    ]
    told = told if decided else ["In this study expect few usable estimates."]
    told += [
        f"{_SYMBOLS[row.parameter]}: undecided in {row.undecided_pct:.0f} % of the injections."
        for row in known
        if _mostly_undecided(row)
    ]
    never = [_SYMBOLS[row.parameter] for row in rows if row.rmse is None]
    told += [f"{' and '.join(never)} cannot be decided here."] if never else []
    return " ".join(told)


def _mostly_undecided(row: ExpectedError) -> bool:
    return row.undecided_pct > _MOSTLY_PCT


def _size(row: ExpectedError) -> str:
    """Return the error in % of the truth, or SI where the truth is too small for that."""
    return _si(row) if row.rmse_pct is None else f"{row.rmse_pct:.0f} %"


def _si(row: ExpectedError) -> str:
    return f"{row.rmse:.3g} {pretty_unit(row.unit)}"


def _small(certificate: Certificate) -> str:
    """Say where errors are told in SI only."""
    told = [
        f"{_SYMBOLS[name]} at {format_count(len(points), 'timing point')} ({', '.join(points)})"
        for name in PARAMETERS
        if (points := _small_points(certificate, name))
    ]
    if not told:
        return ""
    return (
        f" Errors are told in SI units only for {' and '.join(told)}: the truth there is less "
        "than a tenth of what is usual of it, or of its error, and in no error in %."
    )


def _small_points(certificate: Certificate, parameter: str) -> list[str]:
    return [
        row.timing_point
        for row in certificate.errors
        if row.parameter == parameter
        and row.timing_point != ALL_POINTS
        and row.rmse is not None
        and row.rmse_pct is None
    ]


def _note(certificate: Certificate) -> str:
    people = format_count(certificate.n_participants, "participant")
    given = [
        f"{_GIVEN_NAMES.get(name, name)} {how}"
        for name, how in certificate.injected.items()
        if how != "found"
    ]
    drawn = f"; given: {', '.join(given)}" if given else ""
    left_out = "".join(f" {who} was left out: {why}." for who, why in certificate.left_out.items())
    return (
        f"Joints of known impedance were put into the unperturbed strides of {people} "
        f"({format_count(certificate.replicates, 'time')} each), as if the device had pushed "
        f"there, and estimated by the same method{drawn}. The joints are those that the study "
        "found, the errors of lag, friction and gains as large as they may be. What the "
        f"simulated joint does not have, such as a reflex, is not in these errors."
        f"{_small(certificate)}{left_out}"
    )


def _cell(row: ExpectedError | None) -> dict[str, str]:
    if row is None:
        return {"rmse": DASH, "more": ""}
    undecided = f"undecided {row.undecided_pct:.0f} %"
    if row.rmse is None or row.coverage is None:
        return {"rmse": DASH, "more": undecided}
    held = f"held {100 * row.coverage:.0f} %, {undecided}"
    held = undecided if _mostly_undecided(row) else held
    if row.rmse_pct is None or row.bias_pct is None:
        return {"rmse": _si(row), "more": held}
    about = "" if row.rmse_sd_pct is None else f" ± {row.rmse_sd_pct:.1f}"
    bias = format_signed(row.bias_pct, decimals=1)
    return {"rmse": f"{row.rmse_pct:.1f}{about}", "more": f"mean {bias}, {held}"}
