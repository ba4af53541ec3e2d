"""The table of `bench/worn.py`."""

from pathlib import Path

import numpy as np


def table(rows: list[dict]) -> str:
    """Markdown: a line for each body, outfit and variant, over all clips."""
    groups: dict[tuple, list[dict]] = {}
    for row in rows:
        if "error" not in row:
            key = (
                row["body"],
                row["outfit"],
                row["variant"],
                " ".join([row["solver"], *row["set"]]),
            )
            groups.setdefault(key, []).append(row)
    lines = [
        "| body | outfit | variant | solver | clips | pierced in | worst share (clip) | mean "
        "| inside p99 | of one part | inside median | worst edge | edge p95 | jump | of what lies "
        "| crossed p99 | hems lifted | skin shows p99 | creased p99 |",
        "|---" * 19 + "|",
    ]
    for (body, outfit, variant, solver), group in sorted(groups.items()):
        share = "pierced_calm" if variant in ("15hz", "stalls") else "pierced"
        worst = max(group, key=lambda r: r[share])
        most = {
            name: max((value for r in group if isinstance(value := r[name], float)), default=0.0)
            for name in group[0]
        }
        cells = [
            body.removesuffix(".glb"),
            Path(outfit).name.replace("_female.obj", ""),
            variant,
            solver,
            str(len(group)),
            str(sum(r[share] > 0 for r in group)),
            f"{worst[share]:.2f} ({Path(worst['clip']).stem})" if worst[share] else "0",
            f"{np.mean([r[share] for r in group]):.3f}",
            f"{100 * most['inside_p99']:.2f} %",
            f"{100 * most.get('inside_once_p99', float('nan')):.2f} %",
            f"{100 * most['inside_median']:.2f} %",
            f"{100 * most['strain_max']:.0f} %",
            f"{100 * most['strain_p95']:.1f} %",
            f"{most['jump_cm']:.0f} cm",
            f"{most['jump_lying_cm']:.0f} cm",
            f"{100 * most['crossed_p99']:.2f} %",
            f"{100 * most['lifted']:.0f} %",
            f"{100 * most.get('skin_shows_p99', float('nan')):.2f} %",
            f"{100 * most.get('creased_p99', float('nan')):.2f} %",
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"
