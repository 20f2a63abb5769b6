"""Problems of a TOML file, in sentences that begin with the key's full path."""

import difflib
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, TypeVar, get_args, get_origin

from pydantic import BaseModel, ValidationError, create_model

from jointz.core.checked_model import INCONSISTENT, CheckedModel, place_of
from jointz.core.errors import DeviceFileError
from jointz.io.small_files import file_content, parse_toml

Location = tuple[str | int, ...]
_ModelT = TypeVar("_ModelT", bound=CheckedModel)

#: Value in a draft that the files do not decide.
OPEN = "?"

_LONGEST_SHOWN = 80
_VERSION_KEYS = ("jointz", "jointz_protocol")
#: What pydantic calls by the names of Python, in the words of a file.
_EXPECTED = {
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
    "tuple_type": "a list",
    "string_type": "text",
    "string_too_short": "text that is not empty",
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "bool_type": "true or false",
}


def shape_problems(
    error: ValidationError, model: type[BaseModel], raw: Mapping[str, Any]
) -> list[str]:
    """Return what pydantic refused, a sentence each."""
    return [
        _sentence(dict(e), model, raw)
        for e in error.errors()
        if e["type"] != INCONSISTENT and not _follows_from_entries(dict(e))
    ]


def all_problems(
    error: ValidationError, model: type[CheckedModel], raw: Mapping[str, Any]
) -> list[str]:
    """Return what pydantic refused and every inconsistency among what can be read."""
    problems = _inconsistencies(_draft(model, raw), ())
    return [*shape_problems(error, model, raw), *dict.fromkeys(problems)]


def open_questions(raw: Any, place: Location = ()) -> list[str]:
    """Return a sentence for each value that is still open, as jointz inspect drafts it."""
    if raw == OPEN:
        return [
            f'{place_of(place)}: open. Replace "?" by an answer; its line says which there are.'
        ]
    entries: Iterable[tuple[str | int, Any]] = enumerate(raw) if isinstance(raw, list) else ()
    entries = raw.items() if isinstance(raw, Mapping) else entries
    return [text for key, value in entries for text in open_questions(value, (*place, key))]


def read_device_model(name: str, model: type[_ModelT], *, absent: str) -> _ModelT:
    """Return the model of a device's TOML file; raise with all its problems."""
    raw = parse_toml(name, file_content(name, absent=absent), error=DeviceFileError)
    try:
        return model.model_validate(raw)
    except ValidationError as exc:
        raise DeviceFileError(name, all_problems(exc, model, raw)) from exc


def _follows_from_entries(error: Mapping[str, Any]) -> bool:
    """Whether a list is called too short only because its entries were refused."""
    if error["type"] != "too_short":
        return False
    return bool(len(error["input"]) >= error["ctx"]["min_length"])


# --- sentences ---------------------------------------------------------------------------------


def _sentence(error: Mapping[str, Any], model: type[BaseModel], raw: Mapping[str, Any]) -> str:
    location = _written(error["loc"], raw)
    place, kind, shown = place_of(location), error["type"], repr(error["input"])
    shown = shown if len(shown) <= _LONGEST_SHOWN else f"{shown[:_LONGEST_SHOWN]}..."
    if kind == "extra_forbidden":
        return f"{place}: unknown key.{_hint(location, model, raw)}"
    if kind == "missing":
        return f"{place}: missing; it is required."
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        return _kind_sentence(place, error["input"], _models_at(location, model, raw))
    if place in _VERSION_KEYS:
        return f"{place}: schema version {shown} is not one this version reads (1)."
    if kind == "too_short":
        if isinstance(error["input"], str):
            return f"{place}: expected text that is not empty; got {shown}."
        return f"{place}: expected at least {error['ctx']['min_length']} of them; got {shown}."
    if kind == "too_long":
        return f"{place}: expected at most {error['ctx']['max_length']} of them; got {shown}."
    text = str(error["msg"]).removeprefix("Value error, ").replace("Input should be", "expected")
    if kind == "value_error" and isinstance(error["input"], Mapping):
        # Of a whole table: its text names the keys.
        return f"{place}: {text}." if place else f"{text}."
    message = f"expected {_EXPECTED[kind]}" if kind in _EXPECTED else text
    return f"{place}: {message}; got {shown}."


def _kind_sentence(place: str, table: Mapping[str, Any], models: list[type[BaseModel]]) -> str:
    kinds = ", ".join(_kind(model) for model in models)
    if "kind" not in table:
        return f"{place}.kind: missing; expected one of {kinds}."
    close = difflib.get_close_matches(str(table["kind"]), map(_kind, models), n=1)
    hint = f" Did you mean '{close[0]}'?" if close else ""
    return f"{place}.kind: expected one of {kinds}; got {table['kind']!r}.{hint}"


def _hint(location: Location, model: type[BaseModel], raw: Mapping[str, Any]) -> str:
    models = _models_at(location[:-1], model, raw)
    known = sorted(models[0].model_fields) if len(models) == 1 else []
    close = difflib.get_close_matches(str(location[-1]), known, n=1)
    return f" Did you mean '{close[0]}'?" if close else f" Known keys: {', '.join(known)}."


def _written(location: Location, raw: Any) -> Location:
    """Return a location without the kinds that pydantic puts between the keys of a union."""
    kept: list[str | int] = []
    value = raw
    for i, part in enumerate(location):
        last = i == len(location) - 1
        if isinstance(value, Mapping) and part not in value and not last:
            continue
        if i and not isinstance(value, Mapping | list | None):  # nothing is inside a number
            continue
        kept.append(part)
        value = _inside(value, part)
    return tuple(kept)


def _inside(value: Any, part: str | int) -> Any:
    if isinstance(value, Mapping):
        return value.get(part)
    if isinstance(value, list) and isinstance(part, int) and part < len(value):
        return value[part]
    return None


# --- models ------------------------------------------------------------------------------------


def _models_at(location: Location, model: type[BaseModel], raw: Any) -> list[type[BaseModel]]:
    """Return the models that may stand at a place; one, unless its kind is not known."""
    models, value = [model], raw
    annotation: Any = None
    for part in location:
        value = _inside(value, part)
        field = models[0].model_fields.get(str(part)) if len(models) == 1 else None
        # An entry of a list or of a table of tables has the model of the whole.
        annotation = field.annotation if field is not None else annotation
        models = _of_kind(_models_in(annotation), value)
    return models


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in get_args(annotation) for model in _models_in(part)]


def _of_kind(models: list[type[BaseModel]], value: Any) -> list[type[BaseModel]]:
    if len(models) < 2 or not isinstance(value, Mapping):
        return models
    return [m for m in models if _kind(m) == value.get("kind")] or models


def _kind(model: type[BaseModel]) -> str:
    """Return the word by which a model of a union is chosen."""
    return str(get_args(model.model_fields["kind"].annotation)[0])


# --- inconsistencies among what can be read ----------------------------------------------------


def _draft(model: type[BaseModel], raw: Mapping[str, Any]) -> BaseModel:
    """Return a model with what can be read; what cannot is no attribute of it."""
    values, unreadable = {}, []
    for name in model.model_fields:
        if name not in raw:
            continue
        try:
            values[name] = _value(model, name, raw[name])
        except ValidationError:
            unreadable.append(name)
    draft = model.model_construct(_fields_set=set(values) | set(unreadable), **values)
    for name in unreadable:
        draft.__dict__.pop(name, None)  # its default would be taken for what was written
    return draft


def _value(model: type[BaseModel], name: str, raw: Any) -> Any:
    """Return the value of a field, tables and lists of tables as far as they can be read."""
    field = model.model_fields[name]
    models = _of_kind(_models_in(field.annotation), raw)
    is_list = get_origin(field.annotation) is tuple
    if len(models) == 1 and isinstance(raw, Mapping) and not is_list:
        return _draft(models[0], raw)
    if models and isinstance(raw, list) and is_list:
        return tuple(_entry(models, entry) for entry in raw)
    definition: Any = (field.annotation, field)
    alone = create_model(name, __config__=model.model_config, **{name: definition})
    return getattr(alone.model_validate({name: raw}), name)


def _entry(models: list[type[BaseModel]], raw: Any) -> BaseModel | None:
    """Return an entry of a list of tables, None if it is no table or of an unknown kind."""
    models = _of_kind(models, raw)
    return _draft(models[0], raw) if len(models) == 1 and isinstance(raw, Mapping) else None


def _inconsistencies(part: Any, place: Location) -> Iterator[str]:
    if isinstance(part, tuple):
        for i, entry in enumerate(part):
            yield from _inconsistencies(entry, (*place, i))
    if not isinstance(part, CheckedModel):
        return
    for name in type(part).model_fields:
        yield from _inconsistencies(part.__dict__.get(name), (*place, name))
    for check in part.checks():
        try:
            problems = list(check())
        except AttributeError:  # it needs what cannot be read: a problem that is told already
            continue
        for problem in problems:
            yield f"{place_of((*place, *problem.key))}: {problem.message}"
