"""``jointz stream``: a session on Lab Streaming Layer."""

from pathlib import Path
from typing import Annotated

import typer

from jointz.core.stop_signals import end_listening
from jointz.terminal.options import Printing
from jointz.terminal.output import emit, emit_json


def stream(
    session: Annotated[Path, typer.Argument(help="Folder of a study that runs, or of a session.")],
    name: Annotated[
        str, typer.Option(help="Of the stream of channels; markers: NAME markers.")
    ] = "jointz",
    printing: Printing = Printing(),
) -> None:
    """Put every channel of a session and its events on Lab Streaming Layer.

    Follows a session that runs, from now on, by its files alone; plays one that is over at the
    pace it had. Ends with the session, or with Ctrl-C. Never tried beside a real experiment.
    Needs the extra: pip install "jointz[lsl]".

    Example: jointz stream study --name knee
    """
    from jointz.rig.session.live.lab_stream import stream_session

    sent: dict[str, int] = {}
    streams: list[str] = []

    def announce(channels: str, markers: str) -> None:
        streams[:] = [channels, markers]
        if not (printing.quiet or printing.as_json):
            emit(f"Streams: {channels}, {markers}  (Ctrl-C ends it)")

    def count(samples: int, markers: int) -> None:
        sent.update(samples=samples, markers=markers)

    try:
        stream_session(session, name=name, announce=announce, count=count)
    except KeyboardInterrupt:  # the usual end
        end_listening()
    if printing.as_json:
        emit_json({"status": "ok", "streams": streams, **sent})
    elif not printing.quiet and sent:
        emit(f"Sent {sent['samples']} samples and {sent['markers']} markers.")
