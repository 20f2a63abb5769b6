"""Section of the report on the errors to expect in the study."""

from typing import Any

from jointz.core.channels import pretty_unit
from jointz.core.gait_phases import ALL_POINTS
from jointz.report.wording import DASH, format_count, format_signed, parameter_name, point_name
from jointz.results.certificate_result import PARAMETERS, Certificate, ExpectedError
from jointz.results.fit import SYMBOLS

#: If more estimates than this are undecided, the rest are no fair sample of intervals.
_MOSTLY_PCT = 50.0


def certificate_section(certificate: Certificate | None) -> dict[str, Any] | None:
    """Return the sentence and the table of a certificate, None if there is none."""
    if certificate is None or not certificate.errors:
        return None
    errors = {(row.timing_point, row.parameter): row for row in certificate.errors}
    points = sorted(dict.fromkeys(point for point, _ in errors), key=lambda p: p != ALL_POINTS)
    return {
        "sentence": _sentence(certificate),
        "people": certificate.n_participants,
        "world": certificate.world,
        "protocol": certificate.protocol,
        "si_only": _si_only(certificate),
        "left_out": certificate.left_out,
        "symbols": [f"{SYMBOLS[name]}: {parameter_name(name).lower()}" for name in PARAMETERS],
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
    promise = _promise(certificate)
    where = "Simulated people had" if certificate.reasons else "In this study expect"
    if not known:
        return f"{promise}{where} no usable estimate: every estimate was undecided."
    decided = [row for row in known if not _mostly_undecided(row)]
    if decided:
        sizes = ", ".join(f"{_size(row)} in {SYMBOLS[row.parameter]}" for row in decided)
        coverage = ", ".join(f"{100 * (row.coverage or 0.0):.0f} %" for row in decided)
        sentences = [
            f"{promise}{where} errors of {sizes} (root mean square), and intervals that "
            f"contain the truth in {coverage} of cases."
        ]
    else:
        sentences = [f"{promise}{where} few usable estimates."]
    sentences += [
        f"{SYMBOLS[row.parameter]}: undecided in {row.undecided_pct:.0f} % of the estimates."
        for row in known
        if _mostly_undecided(row)
    ]
    never = [SYMBOLS[row.parameter] for row in rows if row.rmse is None]
    sentences += [f"{' and '.join(never)} cannot be estimated here."] if never else []
    return " ".join(sentences)


def _promise(certificate: Certificate) -> str:
    """Return why these errors cannot be promised, "" if they can."""
    if not certificate.reasons:
        return ""
    return f"The errors of this study cannot be promised. {'. '.join(certificate.reasons)}. "


def _mostly_undecided(row: ExpectedError) -> bool:
    return row.undecided_pct > _MOSTLY_PCT


def _size(row: ExpectedError) -> str:
    """Return the error in % of the truth, or in SI units if the truth is too small for that."""
    return _si(row) if row.rmse_pct is None else f"{row.rmse_pct:.0f} %"


def _si(row: ExpectedError) -> str:
    return f"{row.rmse:.3g} {pretty_unit(row.unit)}"


def _si_only(certificate: Certificate) -> list[str]:
    """Name the timing points whose errors are given in SI units only."""
    points: dict[str, list[str]] = {name: [] for name in PARAMETERS}
    for row in certificate.errors:
        if row.timing_point != ALL_POINTS and row.rmse is not None and row.rmse_pct is None:
            points[row.parameter].append(row.timing_point)
    return [
        f"{SYMBOLS[name]} at {format_count(len(own), 'timing point')} ({', '.join(own)})"
        for name, own in points.items()
        if own
    ]


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
