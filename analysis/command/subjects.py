"""Help of a command with many options: a box for each subject, instead of one long list."""

from __future__ import annotations

import ast
import dataclasses
import difflib
import inspect
import itertools
import re
import textwrap
import types
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import tyro

from analysis.command.options import RENAMED
from tsar.named import not_among

MOST = 10
"""Greatest number of options in a box."""

SUBJECTS = {
    "animation": "input inputs figure_input scene scenes scene_files scene_root root camera_path phase vary seconds"
    " start_s time_s warmup_cycles frames first_frame fps still_s limit_s",
    "picture": "size resolution_px width_px height_px sides_px crop frame_px",
    "camera": "camera camera_keys fov_deg lens_radius focal_distance up environment smooth_deg integrator bounces",
    "sample": "samples_per_axis samples point_set rounds error_target denoise shift space_filter time_filter sigma_px"
    " box_share",
    "pipeline": "batch_size framelet_side sdf_side cache_size latency_cycles spatial_slope temporal_slope bias solver"
    " stages",
    "policy": "policy policies rivals left right beside solvers policy_row parts kept",
    "choice": "preset budget_flops budget_seconds mse_target",
    "size": "row rows scale image_hz sample_flops subdivisions cycles",
    "grid": "spatial_slopes temporal_slopes offsets biases",
    "search": "knobs search_knobs trials at_once search_seed store",
    "cost": "ledger capacity trace_segments framed_rate_hz tree_size per_bvh_node per_triangle per_shader",
    "model": "sdf_size framelet_size recon_res recon_age_support recon_spa_support tiling_size dwt_coeffs"
    " avg_recon_overdraw",
    "admitted": "batches resolutions admitted_segments",
    "measurement": "measure measured_batches measured_resolutions measured_batch measured_resolution measured_warmup"
    " cycles_per_turn cycle_s memory_cycles memory_every",
    "slopes": "frames_per_input",
    "ideal": "ideal_start_s span_s ideal_samples ideal_frames tile_level tile_at tile_index tau",
    "agreement": "tiles_per_input agreement_level agreement_samples agreement_frames",
    "metric": "metrics metric_stride reference_rate_hz reference_samples_per_axis jod_s jod_repetitions"
    " jod_span_s before_s tolerance draws",
    "repetition": "seed repetitions bootstraps experiments study",
    "observer": "jnds sigmas lapses spreads observers answers guess_rate threshold disturbed",
    "check": "markers matrix groups mutations plain formats",
    "page": "host port bench bench_seconds",
    "machine": "device isa threads workers workers_least scheduler memory_limit_gib retries worker_wait_s log_level"
    " chunk_tiles",
    "file": "out references write_frames layered_stills film video page layers format explain markdown only compare",
}
"""Subjects in the order of the boxes, each with its options."""

_SUBJECT_OF = {name: subject for subject, names in SUBJECTS.items() for name in names.split()}
_REST = "further"


SET = tyro.constructors.ConstructorRegistry()
"""Types as the help shows them: without ``{None}``, which is the value of an option that is not given."""


@SET.primitive_rule
def _without_none(info: tyro.constructors.PrimitiveTypeInfo) -> Any:
    """The specification of a type that may be None: that of the type without it."""
    kinds = get_args(info.type) if get_origin(info.type) in (Union, types.UnionType) else ()
    if type(None) not in kinds:
        return None
    kind: Any = Union[tuple(one for one in kinds if one is not type(None))]  # noqa: UP007
    spec = tyro.constructors.ConstructorRegistry.get_primitive_spec(info.make(kind, info.markers))
    if not isinstance(spec, tyro.constructors.PrimitiveConstructorSpec):
        return spec
    return dataclasses.replace(
        spec,
        is_instance=lambda value: value is None or spec.is_instance(value),
        str_from_instance=lambda value: [] if value is None else spec.str_from_instance(value),
    )


@dataclasses.dataclass(frozen=True)
class _Option:
    """An option: a field of a record, its type with all marks, and its documentation."""

    field: dataclasses.Field
    kind: Any
    doc: str

    @property
    def marks(self) -> tuple[Any, ...]:
        """Marks of its type."""
        return get_args(self.kind)[1:] if get_origin(self.kind) is Annotated else ()

    @property
    def record(self) -> Any:
        """The record that it holds; None if it is a value."""
        kind = get_args(self.kind)[0] if get_origin(self.kind) is Annotated else self.kind
        return kind if dataclasses.is_dataclass(kind) else None

    @property
    def subject(self) -> str | None:
        """The box that it is shown in; None for positional arguments, and for records, which have their own."""
        alone = self.record or {tyro.conf.Positional, tyro.conf.Suppress}.intersection(self.marks)
        return None if alone else _SUBJECT_OF.get(self.field.name, _REST)

    def spellings(self, name: str) -> tuple[str, ...]:
        """How it is typed where it is called ``name``: one that is on or off has a second form, which says no."""
        kind = get_args(self.kind)[0] if self.marks else self.kind
        before, dot, last = name.rpartition(".")
        return (f"--{name}", f"--{before}{dot}no-{last}") if kind is bool else (f"--{name}",)

    @property
    def member(self) -> tuple[str, Any, Any]:
        """The same as a field of a new record, whose help is that of :func:`by_subject`."""
        copied = dataclasses.field(default=self.field.default, default_factory=self.field.default_factory)  # type: ignore[call-overload]
        if self.record:
            return self._member_record(copied)
        told = next((mark for mark in self.marks if getattr(mark, "help", None)), None)
        kind = get_args(self.kind)[0] if self.marks else self.kind
        given = self.field.default
        unset = given in (None, "", ()) or given is self.field.default_factory  # both missing
        choices = [str(choice) for choice in get_args(kind) if choice] if get_origin(kind) is Literal else []
        words: dict[str, Any] = {"metavar": f"{{{','.join(choices)}}}"} if choices and unset else {}
        words |= {part: getattr(told, part) for part in ("name", "metavar", "constructor") if getattr(told, part, None)}
        hint = "" if unset else None
        shown = tyro.conf.arg(**words, help=told.help if told else self.doc or None, help_behavior_hint=hint)
        marks = (mark for mark in self.marks if mark is not told)
        return self.field.name, Annotated[(kind, shown, *marks)], copied

    def _member_record(self, copied: Any) -> tuple[str, Any, Any]:
        made = _restated(self.record, [one.member for one in _options(self.record, merged=False)])
        values = [one.name for one in dataclasses.fields(made)]

        def default() -> Any:
            given = copied.default_factory() if copied.default is dataclasses.MISSING else copied.default
            return made(**{name: getattr(given, name) for name in values})

        kind = Annotated[(made, *self.marks)] if self.marks else made
        return self.field.name, kind, dataclasses.field(default_factory=default)


def by_subject(options: Any) -> Any:
    """The same options in nested records by subject, if they are more than ten; for the help only.

    The help does not speak of values that stand for none: an option that is not given has no default there.

    Args:
        options: a record of options, or a union of such records, which are commands.

    Returns:
        A record, or a union, whose help has every option of the given one.
    """
    if get_origin(options) in (Union, types.UnionType):
        parts = [(get_args(part)[0], get_args(part)[1:]) for part in get_args(options)]
        return Union[tuple(Annotated[(by_subject(record), *marks)] for record, marks in parts)]  # noqa: UP007
    found = list(_options(options, merged=False))
    boxes = {box: [one.member for one in found if one.subject == box] for box in (*SUBJECTS, _REST)}
    if sum(map(len, boxes.values())) < MOST:  # the help itself is one more
        return _restated(options, [one.member for one in found])
    members = [one.member for one in found if one.subject is None and not one.record]
    for subject, inside in boxes.items():
        if inside:
            record = dataclasses.make_dataclass(subject, inside, namespace={"__doc__": ""})
            members.append((subject, tyro.conf.OmitArgPrefixes[record], dataclasses.field(default_factory=record)))
    members += [one.member for one in found if one.record]
    return _restated(options, members)


def _restated(record: Any, members: Sequence[tuple[str, Any, Any]]) -> Any:
    """A record of other fields, with the name and the documentation of the given one."""
    return dataclasses.make_dataclass(record.__name__, members, kw_only=True, namespace={"__doc__": record.__doc__})


def described(options: Any) -> dict[str, str]:
    """The text of every option of a record, by the name that is typed."""
    return {
        f"--{name}": one.doc or next(mark.help for mark in one.marks if getattr(mark, "help", None))
        for name, one in _named(options)
    }


def renamed(options: Any, given: Sequence[str]) -> str:
    """One line about the first argument that is the earlier name of an option; empty if none is.

    Args:
        options: a record of options, or a union of such records.
        given: arguments of the command line.
    """
    names = {name for record in _records(options).values() for name in described(record)}
    for argument in given:
        old = argument.partition("=")[0]
        for new in RENAMED.get(old, ()):
            if new in names and old not in names:
                return f"{old}: expected {new}, the name of this option now"
    return ""


def unknown(options: Any, given: Sequence[str]) -> str:
    """One line about the step of the command line, or the first option, that is not known; empty if all are.

    Args:
        options: a record of options, or a union of such records.
        given: arguments of the command line.
    """
    records = _records(options)
    step = given[0] if given and len(records) > 1 else ""
    if step not in records:
        return not_among(step, records) if step else ""
    names = [one for name, option in _named(records[step]) for one in option.spellings(name)]
    for argument in given:
        typed = argument.partition("=")[0]
        if re.match(r"--[a-z]", typed) and typed.replace("_", "-") not in names:
            near = difflib.get_close_matches(typed[2:], [name[2:] for name in names], n=1)
            hint = f" (nearest: --{near[0]})" if near else ""
            return f"expected an option of this command, got {typed}{hint}"
    return ""


def _records(options: Any) -> dict[str, Any]:
    """The records of a union by the names of their steps; a record that is no step under an empty name."""
    if get_origin(options) not in (Union, types.UnionType):
        return {"": options}
    parts = [get_args(part) for part in get_args(options)]
    return {next(mark.name for mark in marks if getattr(mark, "name", None)): record for record, *marks in parts}


def _named(record: Any, prefix: str = "") -> Iterator[tuple[str, _Option]]:
    """Options of a record and of those inside it that are typed by name, each with this name, without hyphens before
    it."""
    for one in _options(record, merged=False):
        name = f"{prefix}{one.field.name.replace('_', '-')}"
        if one.record:
            yield from _named(one.record, prefix if tyro.conf.OmitArgPrefixes in one.marks else f"{name}.")
        elif one.subject is not None:
            yield name, one


def _options(record: Any, merged: bool) -> Iterator[_Option]:
    """Options of a record, with those of the records that are merged into it."""
    kinds, docs = get_type_hints(record, include_extras=True), _docs_of(record)
    for field in dataclasses.fields(record):
        option = _Option(field, kinds[field.name], docs.get(field.name, ""))
        if option.record and any(getattr(mark, "name", None) == "" for mark in option.marks):
            yield from _options(option.record, merged=True)
        elif option.record and merged:
            yield dataclasses.replace(option, kind=tyro.conf.OmitArgPrefixes[option.kind])
        else:
            yield option


def _docs_of(record: type) -> dict[str, str]:
    """The documentation of every field of a record: the string below it."""
    found = {}
    for part in reversed(record.__mro__[:-1]):
        (tree,) = ast.parse(textwrap.dedent(inspect.getsource(part))).body
        for field, below in itertools.pairwise(tree.body):  # type: ignore[attr-defined]
            if (
                isinstance(field, ast.AnnAssign)
                and isinstance(below, ast.Expr)
                and isinstance(below.value, ast.Constant)
            ):
                found[field.target.id] = " ".join(str(below.value.value).split())  # type: ignore[union-attr]
    return found
