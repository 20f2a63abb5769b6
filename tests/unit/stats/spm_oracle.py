"""Numbers of spm1d that test_spm.py and test_sign_flip.py compare with.

The curves are made up: seeded noise, smoothed by a Gaussian, with bumps. Tests use
``curves`` only. Run as a program, in an environment of its own that has spm1d (GPL-3, never
a dependency of jointz), this file writes spm_oracle.json beside it:
``python spm_oracle.py``. Made with spm1d 0.4.55, numpy 2.4.6, scipy 1.17.1.
"""

import json
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter1d

#: design, seed, participants of a and b, nodes, sd of the smoothing in nodes, bumps as
#: (node, height, width).
CASES = {
    "one bump": ("paired", 1, 10, 10, 101, 6.0, ((60, 2.5, 9.0),)),
    "noise that crosses": ("paired", 2, 10, 10, 101, 6.0, ()),
    "both ends and below": ("paired", 3, 10, 10, 101, 4.0, ((0, 4, 6), (60, -4, 6), (99, 4, 6))),
    "rough": ("paired", 4, 8, 8, 101, 0.5, ((50, 9.0, 3.0),)),
    "rough, Bonferroni": ("paired", 5, 10, 10, 101, 0.01, ((30, 9.0, 2.0),)),
    "smooth": ("paired", 6, 12, 12, 101, 30.0, ((50, 3.0, 20.0),)),
    "few people": ("paired", 7, 3, 3, 101, 10.0, ((50, 9.0, 20.0),)),
    "many nodes": ("paired", 8, 15, 15, 501, 25.0, ((100, 1.5, 40.0), (350, -2.0, 20.0))),
    "everywhere": ("paired", 9, 10, 10, 61, 5.0, ((30, 9.0, 500.0),)),
    "groups": ("unpaired", 10, 10, 8, 101, 5.0, ((40, 3.0, 9.0),)),
    "groups, noise": ("unpaired", 11, 6, 12, 101, 8.0, ()),
    "groups, two bumps": ("unpaired", 12, 7, 7, 201, 9.0, ((40, 3.5, 9.0), (150, -4.0, 20.0))),
}
FLIPPED = ("one bump", "noise that crosses", "rough")
ALPHA = {"many nodes": 0.01, "smooth": 0.1}


def curves(name: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the two sets of curves of a case, (participant, node)."""
    _, seed, n_a, n_b, nodes, smoothing, bumps = CASES[name]
    rng = np.random.default_rng(seed)
    margin = 100
    noise = rng.standard_normal((n_a + n_b, nodes + 2 * margin))
    smooth = gaussian_filter1d(noise, smoothing, axis=1)[:, margin:-margin]
    smooth /= smooth.std()
    x = np.arange(nodes)
    effect = sum(
        (h * np.exp(-(((x - at) / width) ** 2)) for at, h, width in bumps), np.zeros(nodes)
    )
    return smooth[:n_a] + effect, smooth[n_a:]


def _spm(name: str) -> dict:
    import spm1d

    a, b = curves(name)
    if CASES[name][0] == "paired":
        field = spm1d.stats.ttest_paired(a, b)
    else:
        field = spm1d.stats.ttest2(a, b, equal_var=True)
    test = field.inference(ALPHA.get(name, 0.05), two_tailed=True)
    return {
        "t": [float(t) for t in test.z],
        "df": float(test.df[1]),
        "fwhm_nodes": float(test.fwhm),
        "resels": float(test.resels[1]),
        "threshold": float(test.zstar),
        "p_set": float(test.p_set) if test.clusters else None,
        "clusters": [
            {
                "ends": [float(e) for e in c.endpoints],
                "extent_resels": float(c.extentR),
                "p": float(c.P),
            }
            for c in test.clusters
        ],
    }


def _flips(name: str) -> list[float]:
    """Return the largest t of each flip in order of size, one of every flip and its negative."""
    import spm1d

    field = spm1d.stats.nonparam.ttest_paired(*curves(name))
    return sorted(float(t) for t in field.inference(0.05, two_tailed=True, iterations=-1).PDF0)


def main() -> None:
    """Write the numbers."""
    parts = {
        "spm": {name: _spm(name) for name in CASES},
        "flips": {name: _flips(name) for name in FLIPPED},
    }
    lines = [
        f" {json.dumps(part)}: {{\n"
        + ",\n".join(f"  {json.dumps(k)}: {json.dumps(v)}" for k, v in entries.items())
        + "\n }"
        for part, entries in parts.items()
    ]
    text = "{\n" + ",\n".join(lines) + "\n}\n"
    Path(__file__).with_suffix(".json").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
