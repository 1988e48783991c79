"""A flight's log as an MCAP file: an encoder's channels, written in chunks that a cut leaves whole."""

import time

import foxglove
from foxglove.mcap import MCAPWriteOptions, MCAPWriter

from mission.log import channels
from mission.log.disk import LogFile
from mission.log.encoding import Encoder
from mission.log.records import LoggedMission
from mission.records import Attachment

_CHUNK_BYTES = 256 * 1024


class McapLog:
    """An MCAP file as an encoder's sink. `newest_ns` is the encoder's."""

    def __init__(self, file: LogFile, mission: LoggedMission) -> None:
        context = foxglove.Context()
        # Without seeking, a chunk is written whole once it is full: a file cut anywhere holds only whole chunks.
        options = MCAPWriteOptions(
            profile=channels.PROFILE, chunk_size=_CHUNK_BYTES, disable_seeking=True, compression_threads=0
        )
        self._mcap: MCAPWriter = foxglove.open_mcap(file, context=context, writer_options=options)
        self._encoder = Encoder(context, mission)
        self._mcap.write_metadata(
            channels.PROFILE,
            {
                **mission.metadata,
                "mission": mission.name,
                "mission_sha256": mission.sha256,
                "unix_minus_flight_ns": str(mission.unix_minus_flight_ns),
            },
        )

    @property
    def newest_ns(self) -> int:
        """The newest time [ns, flight] of any record by our own clock."""
        return self._encoder.newest_ns

    def write(self, record: object) -> None:
        """Write a record to every channel that shows it, a file as it is. Raises KeyError for any other type."""
        if isinstance(record, Attachment):
            self._attach(record)
        else:
            self._encoder.write(record)

    def flush(self) -> None:
        """Hand over to the file what is still in memory."""
        self._mcap.flush()

    def close(self) -> None:
        """Finish the file."""
        self._mcap.close()

    def _attach(self, attachment: Attachment) -> None:
        now_ns = time.time_ns()
        self._mcap.attach(
            log_time=now_ns,
            create_time=now_ns,
            name=attachment.name,
            media_type=attachment.media_type,
            data=attachment.data,
        )
