"""Section of the report on the errors to expect in the study."""

from typing import Any

from jointz.core.gait_phases import ALL_POINTS
from jointz.report.wording import (
    DASH,
    SYMBOLS,
    format_count,
    format_signed,
    parameter_name,
    point_name,
    pretty_unit,
)
from jointz.results.certificate_result import PARAMETERS, Certificate, ExpectedError

#: If more injections than this are undecided, the rest are no fair sample of intervals.
_MOSTLY_PCT = 50.0
_INJECTED_NAMES = {"lag_s": "lag in s"}
_SYMBOLS = dict(zip(PARAMETERS, SYMBOLS, strict=True))


def certificate_section(certificate: Certificate | None) -> dict[str, Any] | None:
    """Return the sentence and the table of a certificate, None if there is none."""
    if certificate is None or not certificate.errors:
        return None
    errors = {(row.timing_point, row.parameter): row for row in certificate.errors}
    points = sorted(dict.fromkeys(point for point, _ in errors), key=lambda p: p != ALL_POINTS)
    return {
        "sentence": _sentence(certificate),
        "note": _note(certificate),
        "symbols": [f"{_SYMBOLS[name]}: {parameter_name(name).lower()}" for name in PARAMETERS],
        "rows": [
            {
                "name": point_name(point),
                "cells": [_cell(errors.get((point, name))) for name in PARAMETERS],
            }
            for point in points
        ],
    }


def _sentence(certificate: Certificate) -> str:
    rows = [row for row in certificate.errors if row.timing_point == ALL_POINTS]
    known = [row for row in rows if row.rmse is not None]
    if not known:
        return "Expect no usable estimate in this study: every injected response was undecided."
    decided = [row for row in known if not _mostly_undecided(row)]
    if decided:
        sizes = ", ".join(f"{_size(row)} in {_SYMBOLS[row.parameter]}" for row in decided)
        coverage = ", ".join(f"{100 * (row.coverage or 0.0):.0f} %" for row in decided)
        sentences = [
            f"In this study expect errors of {sizes} (root mean square), and intervals that "
            f"contain the truth in {coverage} of cases."
        ]
    else:
        sentences = ["In this study expect few usable estimates."]
    sentences += [
        f"{_SYMBOLS[row.parameter]}: undecided in {row.undecided_pct:.0f} % of the injections."
        for row in known
        if _mostly_undecided(row)
    ]
    never = [_SYMBOLS[row.parameter] for row in rows if row.rmse is None]
    sentences += [f"{' and '.join(never)} cannot be decided here."] if never else []
    return " ".join(sentences)


def _mostly_undecided(row: ExpectedError) -> bool:
    return row.undecided_pct > _MOSTLY_PCT


def _size(row: ExpectedError) -> str:
    """Return the error in % of the truth, or in SI units if the truth is too small for that."""
    return _si(row) if row.rmse_pct is None else f"{row.rmse_pct:.0f} %"


def _si(row: ExpectedError) -> str:
    return f"{row.rmse:.3g} {pretty_unit(row.unit)}"


def _note(certificate: Certificate) -> str:
    people = format_count(certificate.n_participants, "participant")
    fixed = ", ".join(
        f"{_INJECTED_NAMES.get(name, name)} {value}"
        for name, value in certificate.injected.items()
        if value != "found"
    )
    left_out = "".join(f" {who} was left out: {why}." for who, why in certificate.left_out.items())
    return (
        "Responses of joints with known impedance were added to the unperturbed strides of "
        f"{people} ({format_count(certificate.replicates, 'time')} each), as if the device had "
        "pushed there, and estimated by the same method"
        f"{f'; fixed values: {fixed}' if fixed else ''}. The joints are like those estimated in "
        "the study; the errors of lag, friction and gains are drawn from their uncertainty. "
        "Anything that the simulated joint lacks, such as a reflex, is not included in these "
        f"errors.{_si_only(certificate)}{left_out}"
    )


def _si_only(certificate: Certificate) -> str:
    """Name the timing points whose errors are given in SI units only."""
    points: dict[str, list[str]] = {name: [] for name in PARAMETERS}
    for row in certificate.errors:
        if row.timing_point != ALL_POINTS and row.rmse is not None and row.rmse_pct is None:
            points[row.parameter].append(row.timing_point)
    texts = [
        f"{_SYMBOLS[name]} at {format_count(len(own), 'timing point')} ({', '.join(own)})"
        for name, own in points.items()
        if own
    ]
    if not texts:
        return ""
    return (
        f" Errors are in SI units only for {' and '.join(texts)}: the truth there is less than a "
        "tenth of its usual size, or of its error, so a percentage would mean nothing."
    )


def _cell(row: ExpectedError | None) -> dict[str, str]:
    if row is None:
        return {"rmse": DASH, "more": ""}
    undecided = f"undecided {row.undecided_pct:.0f} %"
    if row.rmse is None or row.coverage is None:
        return {"rmse": DASH, "more": undecided}
    more = f"coverage {100 * row.coverage:.0f} %, {undecided}"
    more = undecided if _mostly_undecided(row) else more
    if row.rmse_pct is None or row.bias_pct is None:
        return {"rmse": _si(row), "more": more}
    about = "" if row.rmse_sd_pct is None else f" ± {row.rmse_sd_pct:.1f}"
    bias = format_signed(row.bias_pct, decimals=1)
    return {"rmse": f"{row.rmse_pct:.1f}{about}", "more": f"mean {bias}, {more}"}
