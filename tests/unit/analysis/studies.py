"""Changes of study folders that several tests make."""


def without_recordings(study, person, condition):
    """Leave the recordings of a person in a condition out of a study's table."""
    file = study.root / "study.toml"
    parts = file.read_text().split("[[recordings]]")
    kept = [p for p in parts if not (f'"{person}"' in p and f'"{condition}"' in p)]
    assert len(kept) < len(parts)
    file.write_text("[[recordings]]".join(kept))
