"""The legend and the sentences beside a scene, as HTML."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

import numpy as np

from planners.viewer.colors import (
    EXECUTED,
    GOAL,
    LEFT_PLAN,
    NOT_ESTIMATED,
    TREE,
    css,
    reliability_colors,
)
from planners.viewer.panel import Panel
from systems.drawing.shapes import Color

_STYLE = "font:13px/1.45 system-ui,sans-serif;color:#222"
_LINE = "width:20px;height:4px;vertical-align:middle"
_DOT = "width:10px;height:10px;border-radius:5px"


def caption_html(panels: Sequence[Panel]) -> str:
    """Return what the colours mean, and what came of each plan."""
    return f'<div style="{_STYLE}">{_legend(panels)}{"".join(map(_summary, panels))}</div>'


def _legend(panels: Sequence[Panel]) -> str:
    planned = np.concatenate([panel.planned_path.colors for panel in panels])
    unknown = (planned == NOT_ESTIMATED[:3]).all(axis=1)
    entries = {
        _scale(): not unknown.all(),
        _entry(_LINE, NOT_ESTIMATED, "planned, no estimator"): unknown.any(),
        _entry(_LINE, EXECUTED, "executed"): any(len(p.executed_path.points) for p in panels),
        _entry(_DOT, LEFT_PLAN, "no longer Close to the plan"): any(
            len(p.left_plan) for p in panels
        ),
        _entry(_DOT, GOAL, "goal"): any(p.goal or len(p.goal_points) for p in panels),
        _entry(_LINE, TREE, "search tree"): any(len(p.tree) for p in panels),
        _in_row("translucent: as planned"): any(p.executed for p in panels),
    }
    return "".join(entry for entry, is_needed in entries.items() if is_needed)


def _scale() -> str:
    stops = ",".join(css(color) for color in reliability_colors(np.linspace(0, 1, 9)))
    bar = f"display:inline-block;width:60px;height:8px;background:linear-gradient(90deg,{stops})"
    return _in_row(f'planned, reliability 0 <span style="{bar}"></span> 1')


def _entry(form: str, color: Color, text: str) -> str:
    mark = f"display:inline-block;margin-right:5px;{form};background:{css(color)}"
    return _in_row(f'<span style="{mark}"></span>{text}')


def _in_row(content: str) -> str:
    return f'<span style="margin-right:16px;white-space:nowrap">{content}</span> '


def _summary(panel: Panel) -> str:
    sentences = " ".join(escape(sentence) for sentence in panel.summary)
    return f'<div style="margin-top:3px"><b>{escape(panel.name)}:</b> {sentences}</div>'
