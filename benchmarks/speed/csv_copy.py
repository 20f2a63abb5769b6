"""Copy of a simulated study as a lab's logger would write it: plain csv with a study.toml."""

from pathlib import Path

import pandas as pd

from jointz.identify.preparation.conditioning import torque_from_current
from jointz.io.formats.netcdf_recording import read_recording
from jointz.io.study_reader import open_study

_COLUMNS = ("time", "angle", "torque", "command", "contact")
_HEAD = """jointz = 1
joint = "knee"
kind = "walking"
coupling = "rigid"
positive = "flexion"
torque_acts_on = "joint"

[channels.time]
column = "time"
unit = "s"
[channels.angle]
column = "angle"
unit = "rad"
[channels.torque]
column = "torque"
unit = "N*m"
[channels.command]
column = "command"
unit = "N*m"
[channels.contact]
column = "contact"
kind = "contact"
"""


def write_csv_copy(study: Path, folder: Path) -> None:
    """Write the recordings of a study with the device as csv, and their study.toml."""
    spec = open_study(study).spec
    folder.mkdir(parents=True)
    lines = [_HEAD]
    for person in spec.participants:
        lines += ["[[participants]]", f'id = "{person.id}"', f"mass_kg = {person.mass_kg}"]
        lines += [f"height_m = {person.height_m}"]
    for entry in spec.recordings:
        if entry.condition == "no_device":
            continue
        recording = read_recording(study / entry.file)
        torque, _ = torque_from_current(recording, spec.torque_model, cutoff_hz=20.0)
        recording = recording.assign(torque=("time", torque))
        table = pd.DataFrame({name: recording[name].to_numpy() for name in _COLUMNS})
        file = entry.file.replace(".nc", ".csv")
        table.dropna().round(6).to_csv(folder / file, index=False)
        lines += ["[[recordings]]", f'participant = "{entry.participant}"']
        lines += [f'condition = "{entry.condition}"', f'file = "{file}"']
    (folder / "study.toml").write_text("\n".join(lines) + "\n")
