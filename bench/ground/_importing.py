"""The table of docs/importing.md from the committed result (``bench.report``)."""

from __future__ import annotations

from typing import Any, Final

BEGIN: Final = "<!-- importing: written by `python -m bench.report` -->"
END: Final = "<!-- end of importing -->"


def document(text: str, result: dict[str, Any]) -> str:
    """The page with its table renewed. Raises ValueError when the markers are missing."""
    if BEGIN not in text or END not in text:
        raise ValueError("docs/importing.md has no place for the table")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    return f"{before}{BEGIN}\n\n{table(result)}\n\n{END}{after}"


def table(result: dict[str, Any]) -> str:
    """One line a file."""
    machine = result["machine"]
    lines = [
        _line(int(side), layout, found) for side, files in result["files"].items() for layout, found in files.items()
    ]
    return "\n".join(
        [
            f"Measured on {machine['cores']} cores ({machine['cpu']}), load {machine['load_before']} before it began. "
            "Seconds by the clock, of processor time in brackets; memory of the process's own, and with pages of "
            "mapped files; disk beside the upload; the longest wait for a sign of progress; the longest until a "
            "cancelled conversion is gone." + _left_out(result),
            "",
            "| float32, deflate | file | examined | converted | samples a second | memory | disk | silence "
            "| cancelled |",
            "|---|---|---|---|---|---|---|---|---|",
            *lines,
        ]
    )


def _left_out(result: dict[str, Any]) -> str:
    """Returns what a run that was stopped did not come to."""
    left = result.get("left_out", [])
    return f" Not measured: {', '.join(left)}." if left else ""


def _line(side: int, layout: str, found: dict[str, Any]) -> str:
    made, seen, stops = found["convert"], found["inspect"], found["cancel_s"].values()
    memory = max(made["anonymous_mib"], seen["anonymous_mib"])
    resident = max(made["resident_mib"], seen["resident_mib"])
    cells = [
        f"{side:,}², {layout}",
        f"{found['file_bytes'] / 1e6:,.0f} MB",
        f"{seen['s']:.1f} s ({seen['cpu_s']:.1f})",
        f"{made['s']:.1f} s ({made['cpu_s']:.1f})",
        f"{made['samples_per_s'] / 1e6:.1f} million",
        f"{memory:,.0f} / {resident:,.0f} MiB",
        f"{made['disk_mib']:,.0f} MiB",
        f"{made['longest_silence_s']:.1f} s",
        f"{max(stops):.2f} s" if stops else "",
    ]
    return f"| {' | '.join(cells)} |"
