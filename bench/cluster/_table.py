"""The figures of docs/operations.md, from bench/results/cluster.json and cluster_simulation.json."""

from __future__ import annotations

from typing import Any, Final

BEGIN: Final = "<!-- servers: written by `python -m bench.report` -->"
END: Final = "<!-- end of servers -->"
AIMS: Final = {"p99": 60.0, "fenced": 8_000, "kill": 8.0, "drain": 2.0, "passing_ms": 2.0, "passing_cores": 0.1}


def document(text: str, result: dict[str, Any], simulation: dict[str, Any]) -> str:
    """The page with its figures renewed. Raises ValueError when the markers are missing."""
    if BEGIN not in text or END not in text:
        raise ValueError("docs/operations.md has no place for the figures of several servers")
    before, after = text.split(BEGIN)[0], text.split(END)[1]
    return f"{before}{BEGIN}\n\n{figures(result)}\n\n{simulated(simulation)}\n\n{END}{after}"


def _met(is_met: bool) -> str:
    return "met" if is_met else "missed"


def figures(result: dict[str, Any]) -> str:
    """What was measured."""
    machine, scene = result["machine"], result["scene"]
    lines = [
        f"`esker bench cluster --json` on {machine['cpu']} ({machine['cores']} cores), "
        f"load {machine['load_before']} before. {result['note']} {scene['clients']} clients append "
        f"{scene['ops_per_s_each']:g} times a second each for "
        f"{scene['seconds']:g} s; on one terrain where there is one server, else on six, some of them passed on.",
        "",
        "| | acknowledged, p50 / p99 | operations, refused | processors: servers | database |",
        "|---|---|---|---|---|",
    ]
    names = {"sqlite": "1 server, SQLite"} | {
        f"postgres_{n}": f"{n} node{'s' * (n > 1)}, PostgreSQL" for n in (1, 2, 3)
    }
    for key, name in names.items():
        found = result[key]
        acks = found["ack_ms"]
        lines.append(
            f"| {name} | {acks['p50']:,.0f} / {acks['p99']:,.0f} ms | {found['acknowledged']:,}, {found['refused']} "
            f"| {found['cores_of_servers']:.2f} | {found['cores'].get('database', 0.0):.2f} |"
        )
    alone, sixty = result["forwarding"]["alone_ms"], result["forwarding"]["cores_for_passing_on"]
    appends, kill, drain = result["appends"], result["after_kill"], result["after_drain"]
    p99 = result["postgres_1"]["ack_ms"]["p99"]
    lines += [
        "",
        "| aim | measured | |",
        "|---|---|---|",
        f"| PostgreSQL: p99 of an acknowledgement ≤ {AIMS['p99']:.0f} ms | {p99:,.0f} ms (SQLite beside it "
        f"{result['sqlite']['ack_ms']['p99']:,.0f}) | {_met(p99 <= AIMS['p99'])} |",
        f"| fenced appends ≥ {AIMS['fenced']:,} a second | {appends['fenced_per_s']:,} (plain INSERTs, 256 a commit: "
        f"{appends['inserts_256_a_commit_per_s']:,}; one a commit: {appends['inserts_one_commit_each_per_s']:,}) "
        f"| {_met(appends['fenced_per_s'] >= AIMS['fenced'])} |",
        _back("killed", kill, AIMS["kill"]),
        _back("stopped", drain, AIMS["drain"]),
        f"| passing on ≤ {AIMS['passing_ms']:.0f} ms | {alone['added_p50']:.1f} ms for one client "
        f"(p50 {alone['at_owner']['p50']:.1f} → {alone['passed_on']['p50']:.1f}) "
        f"| {_met(alone['added_p50'] <= AIMS['passing_ms'])} |",
        f"| passing on ≤ {AIMS['passing_cores']:g} of a processor | {sixty:.2f} "
        f"| {_met(sixty <= AIMS['passing_cores'])} |",
    ]
    return "\n".join(lines)


def _back(how: str, found: dict[str, Any], aim: float) -> str:
    last, median = found["seconds"]["last"], found["seconds"]["median"]
    return (
        f"| clients of a node that is {how} back ≤ {aim:g} s | {found['came_back']} of {found['clients']}, "
        f"the last after {last:.2f} s, half after {median:.2f}; {found['lost']} operations lost | {_met(last <= aim)} |"
    )


def simulated(result: dict[str, Any]) -> str:
    """What arithmetic makes of these costs for a thousand nodes."""
    found = result["simulation"]
    balance, crowd = found["balance"], found["flash_crowd"]
    each_has, weighted = balance["terrains_a_node"], found["balance_with_weights"]["solver_most_to_mean"]
    lines = [
        f"`esker bench cluster --simulate` goes on from these costs to {found['nodes']:,} nodes with "
        f"{found['terrains']:,} terrains: a node has {each_has['least']} to {each_has['most']} of them "
        f"({each_has['mean']:g} on average); the busiest solver has {balance['solver_most_to_mean']:.1f} times the "
        f"average, {weighted:.1f} times where weights say who is free. One node more "
        f"moves {found['one_node_more']['moved']}, all to it.",
        "",
        "| what happens | terrains that move or open | open again after: p50 / p99 / last |",
        "|---|---|---|",
    ]
    for each in found["failures"]:
        one = each["nodes_lost"] == 1
        lines.append(
            f"| {each['nodes_lost']} node{'' if one else 's'} of {found['nodes']:,} die{'s' if one else ''} at once "
            f"| {each['terrains_moved']:,}, none for nothing | {_three(each['seconds_until_open'])} |"
        )
    lines.append(
        f"| a flash crowd: {crowd['terrains']:,} terrains are opened within {crowd['within_s']:g} s "
        f"| {crowd['terrains']:,} | {_three(crowd['seconds_waited'])} |"
    )
    return "\n".join(lines)


def _three(values: dict[str, float]) -> str:
    return f"{values['p50']:.1f} / {values['p99']:.1f} / {values['last']:.1f} s"
