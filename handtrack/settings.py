"""Settings: frozen dataclasses whose fields say their help, range and unit, and check themselves.

A new setting is one field. The command line, what recordings store and the text of `help()` are
made from it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self, get_type_hints

from handtrack.errors import SettingsError, shown


@dataclass(frozen=True)
class About:
    """What is to be known of a setting, beside its type and default.

    Attributes:
        help: one sentence for people.
        choices: the words that it may be.
        least, most: bounds of a number, both possible.
        above: a bound of a number that it may not reach.
        words: what it may be instead of a number.
        unit: of a number.
        flat: its name among all settings, where that is not the field's.
        spelt: how messages call it, where that is not its flat name.
        amount: what a number of it is, as messages say it.
        option: whether the command line has it.
        metavar: how the command line calls its value.
        always: whether recordings hold it though it is at its default.
        count: of numbers, none of them negative, where it is a row of them; or it is empty.
    """

    help: str
    choices: tuple[str, ...] = ()
    least: float | None = None
    most: float | None = None
    above: float | None = None
    words: tuple[str, ...] = ()
    unit: str = ""
    flat: str = ""
    spelt: str = ""
    amount: str = ""
    option: bool = True
    metavar: str | None = None
    always: bool = True
    count: int = 0

    @property
    def expected(self) -> str:
        """What a number may be, in words."""
        if self.above == 0 and self.most is None:
            span = f"a positive number{' of' if self.unit else ''}"
        elif self.most is None:
            span = f"at least {self.least:g}"
        else:
            span = f"{self.least:g}..{self.most:g}"
        number = " ".join(filter(None, (self.amount, span, self.unit)))
        return " or ".join((*self.words, number))

    @property
    def range(self) -> str:
        """What the setting may be, for a list of settings."""
        if self.choices:
            return ", ".join(self.choices)
        numeric = (self.least, self.most, self.above) != (None, None, None)
        return self.expected if numeric else ""


def setting(default: Any, help: str, **about: Any) -> Any:
    """A field of `Settings`; `about` as in `About`."""
    return field(default=default, metadata={"about": About(help, **about)})


@dataclass(frozen=True)
class Known:
    """A setting among all that an object of settings holds.

    Attributes:
        group: the field that holds it, "" for the object itself.
        field: its name there.
        about: what is to be known of it.
        kind: its type.
        default: its value unless told otherwise.
    """

    group: str
    field: str
    about: About
    kind: Any
    default: Any


@dataclass(frozen=True)
class Settings:
    """Settings that are checked when they are made, and known by flat names.

    Raises:
        SettingsError: a value that cannot be used.
    """

    def __post_init__(self) -> None:
        for of in fields(self):
            value = getattr(self, of.name)
            if hasattr(value, "dtype") and hasattr(value, "item"):  # NumPy's numbers are not JSON
                value = value.item()
                object.__setattr__(self, of.name, value)
            about = of.metadata.get("about")
            if about is not None and about.count and isinstance(value, list):
                value = tuple(value)
                object.__setattr__(self, of.name, value)
            if about is None:
                if not isinstance(value, type(of.default)):
                    kind = type(of.default).__name__
                    raise SettingsError(f"{of.name} is {shown(value)}, expected {kind}")
            else:
                _check(about.spelt or about.flat or of.name, value, about, of.default)

    @classmethod
    def known(cls) -> dict[str, Known]:
        """All settings by their flat names."""
        if "_known" not in cls.__dict__:
            found: dict[str, Known] = {}
            kinds = get_type_hints(cls)
            for of in fields(cls):
                about = of.metadata.get("about")
                if about is None:
                    inner = kinds[of.name].known()
                    found |= {n: replace(known, group=of.name) for n, known in inner.items()}
                else:
                    name = about.flat or of.name
                    found[name] = Known("", of.name, about, kinds[of.name], of.default)
            cls._known = found  # type: ignore[attr-defined]
        known: dict[str, Known] = cls._known  # type: ignore[attr-defined]
        return known

    @classmethod
    def default(cls) -> Self:
        """Those of a call that gives none; they are checked once."""
        if "_default" not in cls.__dict__:
            cls._default = cls()  # type: ignore[attr-defined]
        made: Self = cls._default  # type: ignore[attr-defined]
        return made

    @classmethod
    def of(
        cls,
        settings: Settings | Mapping[str, Any] | None = None,
        options: Mapping[str, Any] | None = None,
    ) -> Self:
        """The settings of a call.

        Args:
            settings: these, some of these, or values by flat names; the defaults if left out.
            options: values by flat names that replace them.

        Raises:
            SettingsError: a name is unknown (those known are listed), or a value cannot be used.
        """
        if not isinstance(settings, cls):
            given = settings.flat() if isinstance(settings, Settings) else settings
            if given is not None and not isinstance(given, Mapping):
                raise SettingsError(f"settings are {shown(given)}, expected {cls.__name__}")
            settings = cls.default().but(**(given or {}))
        return settings.but(**options) if options else settings

    def but(self, **options: Any) -> Self:
        """These settings with some values, by flat names, replaced.

        Raises:
            SettingsError: as `of`.
        """
        if not options:
            return self
        known = self.known()
        unknown = [name for name in options if name not in known]
        if unknown:
            raise SettingsError(
                f"setting {unknown[0]!r} is unknown, expected one of {', '.join(known)}"
            )
        own: dict[str, Any] = {}
        inner: dict[str, dict[str, Any]] = {}
        for name, value in options.items():
            at = known[name]
            values = inner.setdefault(at.group, {}) if at.group else own
            values[at.field] = value
        for name, values in inner.items():
            own[name] = replace(getattr(self, name), **values)
        return replace(self, **own)

    def flat(self) -> dict[str, Any]:
        """All values by their flat names."""
        return {
            name: getattr(getattr(self, at.group) if at.group else self, at.field)
            for name, at in self.known().items()
        }

    def to_dict(self) -> dict[str, Any]:
        """What recordings store: plain JSON values by flat names."""
        known = self.known()
        return {
            name: list(value) if isinstance(value, tuple) else value
            for name, value in self.flat().items()
            if known[name].about.always or value != known[name].default
        }


def _check(name: str, value: Any, about: About, default: Any) -> None:
    """Refuse a value that cannot be used."""
    if about.count:
        if not _is_row(value, about.count):
            wanted = f"{about.count} numbers, none of them negative, or none"
            raise SettingsError(f"{name} is {shown(value)}, expected {wanted}")
        return
    if isinstance(default, bool) and isinstance(value, bool):
        return
    if about.choices:
        if not isinstance(value, str) or value not in about.choices:
            raise SettingsError(f"{name} {value!r} is unknown, expected {_one_of(about.choices)}")
        return
    if isinstance(default, bool):
        raise SettingsError(f"{name} is {value!r}, expected True or False")
    if isinstance(default, str) and not about.words:
        if not isinstance(value, str):
            raise SettingsError(f"{name} is {shown(value)}, expected a name")
        return
    if (value is None and default is None) or (isinstance(value, str) and value in about.words):
        return
    right = int if isinstance(default, int) else (int, float)
    if (
        not isinstance(value, right)
        or isinstance(value, bool)
        or not (about.least is None or value >= about.least)
        or not (about.most is None or value <= about.most)
        or not (about.above is None or about.above < value < float("inf"))
    ):
        said = repr(value) if isinstance(value, str) else shown(value)
        raise SettingsError(f"{name} is {said}, expected {about.expected}")


def _is_row(value: Any, count: int) -> bool:
    if not isinstance(value, tuple) or len(value) not in (0, count):
        return False
    return all(isinstance(x, float | int) and 0 <= x < float("inf") for x in value)


def _one_of(choices: tuple[str, ...]) -> str:
    return " or ".join(choices) if len(choices) == 2 else f"one of {', '.join(choices)}"
