"""Each node in turn is killed and started again."""

from soak.avatar import NODES, Avatar
from soak.report import Row

PARAMETERS = {"mocap_player": {"rate": 60.0}}


def run(lengths):
    took = {name: [] for name in NODES}
    rows = []
    with Avatar("/soak_killed") as avatar:
        for name in NODES:
            avatar.start(name, **PARAMETERS.get(name, {}))
        avatar.follow()
        for _ in range(lengths.kills):
            for name in NODES:
                avatar.kill(name)
                avatar.start(name, **PARAMETERS.get(name, {}))
                took[name].append(avatar.follow())
                rows += [row for row in avatar.ends() if not row.holds]
        told = [
            Row(f"cloth again after {name} was killed, longest", f"{max(times):.1f} s")
            for name, times in took.items()
        ]
        return [*told, *rows, *avatar.ends()]
