"""The audit of the printed text as tables of chapters."""

import re
from typing import Final

from jointz.reference import Finding
from jointz.reference.audit import audit
from jointz.reproduction.reproduction_tables import Claim, ClaimTable, Verdict

_CHAPTER: Final = re.compile(r"\d")


def audit_claims(*chapters: int) -> ClaimTable:
    """Return the audit of the printed text as a table."""
    rows = tuple(_finding(f) for f in audit() if not chapters or _chapter(f) in chapters)
    return ClaimTable(
        "audit",
        "What the printed text says against itself",
        "Recomputed from the printed tables and numbers; nothing of it is corrected on this page.",
        rows,
    )


def _chapter(finding: Finding) -> int:
    found = _CHAPTER.search(finding.where)
    if found is None:
        raise ValueError(f"audit_claims: expected a number in {finding.where!r}")
    return int(found.group())


def _finding(finding: Finding) -> Claim:
    verdict: Verdict = finding.kind
    # Of 4.3.2.2 it is shown (tables factors and pairs) what reproduces it.
    if finding.where == "4.3.2.2" and finding.kind == "not reproduced":
        verdict = "only with replicates as people"
    return Claim(
        where=finding.where,
        claim=finding.what,
        printed=finding.printed,
        ours=finding.recomputed,
        verdict=verdict,
        remark=finding.remark,
    )
