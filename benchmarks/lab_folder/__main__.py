"""Write the forms or the planted errors, analyse and score them. See the package."""

import argparse
import json
import re
from pathlib import Path

import pandas as pd
from benchmarks.lab_folder import forms, planted, scores, shared, simulation


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.lab_folder", description=__doc__)
    parser.add_argument("--out", type=Path, required=True, help="new folder")
    parser.add_argument("--seeds", type=int, nargs="+", default=[5, 6])
    parser.add_argument("--forms", nargs="+", choices=list(forms.WRITERS), default=[*forms.WRITERS])
    parser.add_argument("--planted", action="store_true", help="errors in the form mat instead")
    parser.add_argument("--shared", type=Path, help="folder of lab_folder/make.py: its people too")
    options = parser.parse_args()
    options.out.mkdir(parents=True)
    run = _run_planted if options.planted else _run_forms
    tables: list[pd.DataFrame] = []
    for source in ("own", "shared") if options.shared else ("own",):
        for seed in options.seeds:
            folder = options.out / f"{source}{seed}"
            folder.mkdir()
            people = simulation.draw_people(seed)
            if source == "shared":
                people = shared.make_people(options.shared, folder / "given", seed)
            truth = json.dumps({person.id: person.truth for person in people}, indent=1)
            (folder / "truth.json").write_text(truth)
            new = run(options.forms, people, folder, seed)
            tables += [table.assign(source=source, seed=seed) for table in new]
    everything = pd.concat(tables, ignore_index=True)
    everything.to_csv(options.out / "rows.csv", index=False)
    table = everything if options.planted else scores.compare_forms(everything)
    table.to_csv(options.out / "table.csv", index=False)
    print("\n" + scores.format_markdown(table.drop(columns="messages", errors="ignore")))


def _run_forms(
    chosen: list[str], people: list[simulation.Person], folder: Path, seed: int
) -> list[pd.DataFrame]:
    tables = []
    for form in chosen:
        forms.write_study(form, people, folder / form, seed)
        cells, _, messages = scores.analyze(folder / form, people)
        _print_messages(f"{folder.name} {form}", messages)
        tables.append(cells.assign(form=form))
    return tables


def _run_planted(
    _forms: list[str], people: list[simulation.Person], folder: Path, seed: int
) -> list[pd.DataFrame]:
    rows, usual = [], set()
    for name in planted.FAULTS:
        forms.write_study("mat", planted.plant(people, name, seed), folder / name, seed)
        cells, exclusions, messages = scores.analyze(folder / name, people)
        plain = {message: re.sub(r"[\d.]+", "", message) for message in messages}
        new = [message for message, words in plain.items() if words not in usual]
        usual = usual or set(plain.values())  # of the first case, which has no error
        _print_messages(f"{folder.name} {name}", new)
        failures = cells.loc[~cells["status"].isin(["ok", "undecided", "at_bound"]), "status"]
        codes = ", ".join(sorted(set(failures)))
        row = {"case": name} | scores.count(cells) | {"failures": codes, "excluded": exclusions}
        rows.append(row | {"new_messages": len(new), "messages": " / ".join(new)})
    return [pd.DataFrame(rows)]


def _print_messages(title: str, messages: list[str]) -> None:
    print(f"\n{title}", *(f"  {message}" for message in messages), sep="\n", flush=True)


if __name__ == "__main__":
    main()
