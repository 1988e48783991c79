"""What a damaged log lacks, in a sentence, and as a copy of such a log keeps it."""

import dataclasses
import json
from dataclasses import dataclass

from drivers.clock import NS_PER_S
from drivers.mcap_stream import Damage, McapFile

METADATA = "lineflight damage"
"""The metadata in which a copy keeps what its original lacked: the copy itself is sound."""

CUT_OFF = "The log was cut off; this is what it still holds."

_LEAST_SAID_NS = NS_PER_S // 20  # shorter is 0.0 s


@dataclass(frozen=True, slots=True)
class Flaws:
    """What a log lacks: what is `damage`d of it, and its end where it was cut off, since its program died."""

    damage: Damage | None
    is_cut_off: bool

    @property
    def lines(self) -> tuple[str, ...]:
        """A sentence for each of both that is so."""
        words = () if self.damage is None else (words_of_damage(self.damage),)
        return (CUT_OFF, *words) if self.is_cut_off else words


def damage_of(log: McapFile) -> Damage | None:
    """What a log lacks that has been read, with what the one lacked that it is a copy of; None where nothing does."""
    inherited = log.metadata.get(METADATA)
    if inherited is None:
        return log.damage
    fields = json.loads(inherited["damage"])
    before = Damage(**fields | {"holes_ns": tuple((begin, end) for begin, end in fields["holes_ns"])})
    now = log.damage
    if now is None:
        return before
    return Damage(
        before.n_skipped + now.n_skipped,
        before.n_parts + now.n_parts,
        before.holes_ns + now.holes_ns,
        is_all_known=before.is_all_known and now.is_all_known,
        n_nameless=before.n_nameless + now.n_nameless,
    )


def as_metadata(damage: Damage) -> dict[str, str]:
    """What a copy keeps under METADATA."""
    return {"damage": json.dumps(dataclasses.asdict(damage))}


def words_of_damage(damage: Damage) -> str:
    """How much of a log was skipped, in a sentence."""
    if not damage.n_skipped and not damage.n_nameless:
        return "This log is damaged, but not where the flight's records are: none of them is missing."
    words = []
    if damage.n_skipped:
        verbs = "is damaged and was" if damage.n_skipped == 1 else "are damaged and were"
        words.append(f"{damage.n_skipped} of {damage.n_parts} parts of this log {verbs} skipped")
    if damage.n_nameless:
        verbs = "record was" if damage.n_nameless == 1 else "records were"
        words.append(f"{damage.n_nameless} {verbs} skipped because what they are cannot be told any more")
    return ", and ".join(words) + _missing(damage)


def _missing(damage: Damage) -> str:
    seconds = f"{damage.missing_ns / NS_PER_S:.1f} s of the flight are missing"
    if not damage.is_all_known:
        at_least = f": at least {seconds}" if damage.missing_ns >= _LEAST_SAID_NS else ""
        return f"{at_least or ': how much of the flight is missing cannot be told'}."
    return f": {seconds}." if damage.missing_ns >= _LEAST_SAID_NS else "."
