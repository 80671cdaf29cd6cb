"""What all tables of a file share, and their validation, which finds all problems in one pass.

`validate` returns two readings of a document. The strict one exists only if pydantic found no problem. The draft always
exists, with None in place of invalid values, so that checks that need several keys (a camera outside the room) can run
in the same pass.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Annotated, Any, ClassVar, Literal, TypeVar, Union, get_args, get_origin

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    ValidationError,
    ValidationInfo,
    WrapValidator,
    field_validator,
    model_validator,
)
from pydantic_core import PydanticCustomError

from scenes.errors import Location, Problems
from scenes.reading.limits import LONGEST_NAME

__all__ = [
    "ONE_SEARCH",
    "Count",
    "Item",
    "Name",
    "Number",
    "Positive",
    "Spec",
    "allowed_keys",
    "child_tables",
    "known",
    "narrowed",
    "one_of",
    "present",
    "validate",
]

ONE_SEARCH = "there is one search, which finds more than each of the former two"
"""Reason for the removal of `search` from sweep and schedule files."""

DRAFT = {"draft": True}
"""Validation context of the draft."""


def _is_draft(info: ValidationInfo) -> bool:
    return info.context is DRAFT


class Spec(BaseModel):
    """A table of a file. A field with a description is a leaf; the description states what is allowed there."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    replaces: ClassVar[dict[str, tuple[str, ...]]] = {}
    """Keys that an override of another key removes, because they are alternatives."""

    removed: ClassVar[dict[str, str]] = {}
    """Keys of earlier versions, with the reason for their removal."""

    @model_validator(mode="before")
    @classmethod
    def _keep_what_is_known(cls, data: Any, info: ValidationInfo) -> Any:
        if not _is_draft(info) or not isinstance(data, dict):
            return data
        fields = _fields(cls)
        absent = {key: None for key, field in fields.items() if field.is_required() and key not in data}
        return absent | {key: value for key, value in data.items() if key in fields}

    @field_validator("*", mode="wrap")
    @classmethod
    def _one_problem_a_leaf(cls, value: Any, handler: Any, info: ValidationInfo) -> Any:
        try:
            return handler(value)
        except ValidationError as error:
            if _is_draft(info):
                return None
            allowed = cls.model_fields[info.field_name or ""].description
            if allowed is None:
                raise
            if any(item["type"] == "finite_number" for item in error.errors(include_url=False)):
                allowed += "; finite numbers, not nan or inf"
            raise PydanticCustomError("allowed", "{allowed}", {"allowed": allowed}) from None


def _drop_if_draft(value: Any, handler: Any, info: ValidationInfo) -> Any:
    try:
        return handler(value)
    except ValidationError:
        if _is_draft(info):
            return None
        raise


Item = WrapValidator(_drop_if_draft)
"""Wraps the tables of a list, so that one of an unknown kind does not hide the others from the checks."""

# TOML's own types only: no text that looks like a number, no true for 1; nan and inf are not allowed.
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[Number, Field(gt=0, description="a number above 0")]
Count = Annotated[int, Field(strict=True, ge=1, description="a whole number, 1 or more")]
# Dots separate the keys of an override, and commas the columns of a table.
Name = Annotated[
    str,
    Field(
        strict=True,
        max_length=LONGEST_NAME,
        pattern=r"^\w[\w -]*$",
        description=f"text of letters, digits, spaces, - and _, {LONGEST_NAME} at most",
    ),
]

S = TypeVar("S", bound=Spec)


def one_of(key: str, *tables: type[Spec]) -> Any:
    """The annotation for any of `tables`, which are distinguished by the value of `key`."""
    names = {tag: table.__name__ for table in tables for tag in _kinds(table)[key]}

    def name_of(value: Any) -> str | None:
        kind = value.get(key) if isinstance(value, dict) else getattr(value, key, None)
        return names.get(kind) if isinstance(kind, str) else None

    # Not Field(discriminator=key): pydantic refuses it if a wrapping validator, like that of `Spec`, guards the key.
    tagged = tuple(Annotated[table, Tag(table.__name__)] for table in tables)
    return Annotated[Union[tagged], Discriminator(name_of)]  # noqa: UP007


def validate(model: type[S], document: dict[str, Any], problems: Problems) -> tuple[S | None, S]:
    """The strict reading of `document` (None if pydantic found problems, which go to `problems`) and its draft."""
    strict = None
    try:
        strict = model.model_validate(document)
    except ValidationError as error:
        # Unknown keys first: they determine which missing keys are only misspelt.
        for item in sorted(error.errors(include_url=False), key=lambda item: item["type"] != "extra_forbidden"):
            _report(model, dict(item), problems)
    return strict, model.model_validate(document, context=DRAFT)


def _report(model: type[Spec], item: dict[str, Any], problems: Problems) -> None:
    location, owners, below = _location_in_file(model, item["loc"])
    match item["type"]:
        case "extra_forbidden" if location[-1] in owners[0].removed:
            problems.removed_key(location, owners[0].removed[str(location[-1])])
        case "extra_forbidden":
            problems.unknown_key(location, allowed_keys(owners[0]))
        case "missing":
            field = _fields(owners[0])[str(location[-1])]
            items = _listed(location, below) if below and _is_list(field.annotation) else _described(below)
            problems.add(location, field.description or items)
        case "union_tag_invalid" | "union_tag_not_found":
            kind = next(iter(_kinds(below[0])))
            problems.add((*location, kind), ", ".join(tag for table in below for tag in _kinds(table)[kind]))
        case "too_short":
            # Pydantic does not count the items that it has reported already.
            if not item["input"]:
                problems.add(location, _listed(location, below) if below else "at least one")
        case "too_long":
            most = item["ctx"]["max_length"]
            problems.add(location, f"at most {most}; there are {len(item['input'])}")
        case "tuple_type":
            problems.add(location, _listed(location, below))
        case "model_type" | "model_attributes_type":
            problems.add(location, _described(below))
        case _:
            problems.add(location, item["msg"].removeprefix("Input should be "))


def _described(tables: tuple[type[Spec], ...]) -> str:
    return " or ".join(f"a table with {', '.join(allowed_keys(table))}" for table in tables)


def _listed(location: Location, tables: tuple[type[Spec], ...]) -> str:
    """What is allowed for a list of tables, in TOML's notation: [[cameras]]."""
    key = ".".join(step for step in location if isinstance(step, str))
    return f"at least one [[{key}]], each {_described(tables)}"


def _is_list(annotation: Any) -> bool:
    return get_origin(annotation) is tuple or any(_is_list(part) for part in get_args(annotation))


# ---- parts of a draft ---------------------------------------------------------------------------------------------


def present(items: Iterable[Any] | None) -> Iterator[tuple[int, Any]]:
    """The valid items of a draft's list, with their indices."""
    return ((index, item) for index, item in enumerate(items or ()) if item is not None)


def known(*values: object) -> bool:
    """Whether all of these parts of a draft are valid."""
    return all(value is not None for value in values)


# ---- walking from a document to the tables that describe it --------------------------------------------------------


def _fields(table: type[Spec]) -> dict[str, Any]:
    return {field.alias or name: field for name, field in table.model_fields.items()}


def allowed_keys(table: type[Spec]) -> list[str]:
    """The keys that `table` may have, its own before inherited ones."""
    own = table.__annotations__
    return sorted(_fields(table), key=lambda key: key not in own)


def tables_in(annotation: Any) -> tuple[type[Spec], ...]:
    """The tables that a value of the annotated type may be or contain, also in lists, unions and optional ones."""
    if get_origin(annotation) is None:
        return (annotation,) if isinstance(annotation, type) and issubclass(annotation, Spec) else ()
    return tuple(table for part in get_args(annotation) for table in tables_in(part))


def narrowed(tables: tuple[type[Spec], ...], data: object) -> tuple[type[Spec], ...]:
    """The one of `tables` whose kind `data` has; all of them if it has none."""
    given = data if isinstance(data, dict) else {}
    fitting = (table for table in tables if any(given.get(key) in tags for key, tags in _kinds(table).items()))
    return tuple(fitting) or tables


def _kinds(table: type[Spec]) -> dict[str, tuple[str, ...]]:
    fields = _fields(table).items()
    return {key: get_args(field.annotation) for key, field in fields if get_origin(field.annotation) is Literal}


def child_tables(table: type[Spec], key: str) -> tuple[type[Spec], ...]:
    """The tables below `key` of `table`, none for a leaf or an unknown key."""
    field = _fields(table).get(key)
    return tables_in(field.annotation) if field is not None else ()


def _location_in_file(
    model: type[Spec], loc: Location
) -> tuple[Location, tuple[type[Spec], ...], tuple[type[Spec], ...]]:
    """Pydantic's location without the tags it inserts; the tables of its last key, and those below it."""
    location: list[str | int] = []
    owners = tables = (model,)
    for step in loc:
        kind = tuple(table for table in tables if step == table.__name__)
        if kind:
            tables = kind
            continue
        location.append(step)
        if isinstance(step, str) and tables:
            owners, tables = tables, child_tables(tables[0], step)
    return tuple(location), owners, tables
