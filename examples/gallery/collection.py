"""
From results to a collection
============================

A collection keeps what many labs found. A results folder becomes an entry
(:func:`~jointz.collections.entry.make_entry`), a check says what the page of the entry
lacks, and the catalog of all entries can be asked. On the command line it is ``jointz collect``;
the catalog needs ``pip install "jointz[scale]"``.
"""

import re
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt

import jointz
from jointz.analysis.results_folder import write_results
from jointz.collections.catalog import build_catalog, query_catalog
from jointz.collections.catalog_query import CatalogFilter
from jointz.collections.checking.check_collection import check_collection
from jointz.collections.dissertation_entry import write_dissertation_entry
from jointz.collections.entry import make_entry
from jointz.session.simulate_study import simulate_study

# %%
# A lab of our own, simulated, and the published tables, which come with jointz:

folder = Path(mkdtemp())
study = simulate_study(folder / "study", lag_sd_s=0.0005, seed=26)
write_results(jointz.analyze(study, resamples=2), folder / "results")
shared = folder / "collection"
page = make_entry(folder / "results", out=shared / "our-knees", study_id="our-knees")
write_dissertation_entry(shared / "dissertation")
print(check_collection(shared).summary())

# %%
# What the results know is in the page. What only the lab knows stands there as comments, and
# nothing goes into a catalog before somebody has filled them in:

told = {
    "title": '"The knee of a simulated person"',
    "licence": '"CC0-1.0"',
    "cite": '"Nobody (2026): The knee of a simulated person."',
    "protocol": '"walking"',
    "contributors": '[{ name = "Nobody" }]',
    "side": '"right"',
    "age_band": '"20-29"',
    "sex": '"not_stated"',
    "walking_speed_m_s": "1.2",
    "slope_deg": "0.0",
    "surface": '"treadmill"',
    "where": '"simulate_study(seed=26)"',
    "approval": '"none: nobody was measured"',
    "consent": '"public"',
}
text = page.read_text(encoding="utf-8")
text = re.sub(r"# name =.*what perturbed.*", 'name = "a simulated exoskeleton"', text)
text = re.sub(r"# name =.*no other condition.*", 'name = "level-1.2"', text)
for key, value in told.items():
    text = re.sub(rf"# {key} =.*", f"{key} = {value}", text)
page.write_text(text, encoding="utf-8")
checked = check_collection(shared)
assert not checked.findings
print(checked.summary())

# %%
# The catalog, and a question. Printed values are never mixed with estimates:

print(build_catalog(shared).summary())
answers = {
    kind: query_catalog(shared, CatalogFilter(parameter=("stiffness_per_mass",), kind=kind))
    for kind in ("estimates", "printed")
}
for kind, answer in answers.items():
    print(kind, len(answer.to_frame()), "rows; cite", "; ".join(answer.cites.values()))
answers["printed"].groups()

# %%
figure, axes = plt.subplots()
rows = answers["printed"].to_frame().query("statistic == 'individual'")
axes.plot(rows["onset_gait_pct"], rows["value"], ".", color="0.6", label="dissertation, printed")
rows = answers["estimates"].to_frame().dropna(subset="value")
reach = [rows["value"] - rows["ci_low"], rows["ci_high"] - rows["value"]]
axes.errorbar(rows["onset_gait_pct"], rows["value"], reach, fmt="o", label="our-knees")
axes.set(xlabel="Onset (% of the gait cycle)", ylabel="Stiffness per mass (N*m/rad/kg)")
axes.legend()

# %%
# One lab's person with intervals among ten people of another, whose table prints none. How to make
# one value of several labs: :ref:`pooling <sphx_glr_gallery_pool_labs.py>`.
