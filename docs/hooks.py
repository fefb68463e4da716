"""Pages that nobody writes: of every group from its declared parameters, of every study from its results.

They are made while the site is built, so they cannot go stale.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

from uavexp import causes
from uavexp.cli.helptext import described, groups_of
from uavexp.config.options import Option
from uavexp.metrics.evaluate import METRICS
from uavexp.metrics.metric import Metric

ROOT = Path(__file__).parents[1]
PAPERS = {
    "mcr": "Paper 1",
    "voxel": "Paper 2",
    "inspect": "Paper 3",
    "dfbit": "Paper 4",
    "barn": "BARN",
    "safe": "Safe flights",
    "real": "Real buildings",
    "tune": "Tuning",
    "benchmark": "Benchmark",
}
SHIPPED = {
    "CONTRIBUTING.md": "contributing.md",
    "CHANGELOG.md": "changelog.md",
    "examples/README.md": "examples.md",
}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add the generated pages to the navigation."""
    groups = [{group: f"reference/{group}.md"} for group in groups_of()]
    studies = [
        {title: [{folder.name: f"{folder.relative_to(ROOT).as_posix()}/index.md"} for folder in folders]}
        for title, folders in _studies()
    ]
    config.nav = [*(config.nav or []), {"Parameters": groups}, {"Results": studies}]
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages, and what they and the written ones show."""
    for group in groups_of():
        files.append(File.generated(config, f"reference/{group}.md", content=_group_page(group)))
    for _, folders in _studies():
        for folder in folders:
            name = f"{folder.relative_to(ROOT).as_posix()}/index.md"
            files.append(File.generated(config, name, content=_study_page(folder)))
    for source, name in SHIPPED.items():
        files.append(File.generated(config, name, content=_without_repository_links(ROOT / source)))
    for path in _shown():
        name = path.relative_to(ROOT).as_posix()
        if path.suffix == ".md":
            files.append(File.generated(config, name, content=_without_repository_links(path)))
        else:
            files.append(File.generated(config, name, abs_src_path=str(path)))
    return files


def _studies() -> Iterator[tuple[str, list[Path]]]:
    """Folders of the committed studies, by paper."""
    for paper, title in PAPERS.items():
        if folders := sorted(file.parent for file in ROOT.glob(f"experiments/{paper}/results/*/study.json")):
            yield title, folders


def _shown() -> Iterator[Path]:
    """Pictures and texts of the results."""
    for pattern in ("*.md", "pictures/*.png", "*/figures/*.png"):
        for path in sorted(ROOT.glob(f"experiments/*/results/{pattern}")):
            if path.name != "README.md":
                yield path


def _without_repository_links(file: Path) -> str:
    """A text whose links to files of the repository are names: the site does not hold those files."""
    return re.sub(r"(?<!!)\[([^\]]+)\]\((?!https?:)[^)]*\)", r"\1", file.read_text(encoding="utf-8"))


def _group_page(group: str) -> str:
    """Every option of a group with its parameters."""
    lines = [f"# {group}", ""]
    for name, option, words in described(group):
        lines += [f"## {group}={name}", "", words, "", *_parameters(group, option)]
    return "\n".join(lines)


def _parameters(group: str, option: Option) -> list[str]:
    if not option.parameters:
        return []
    rows = [
        f"| `{group}.{item.name}` | `{item.default or ' '}` | {item.comment.replace('|', chr(92) + '|')} |"
        for item in option.parameters
    ]
    return ["| parameter | default | meaning |", "|---|---|---|", *rows, ""]


def on_page_markdown(markdown: str, page: Page, **_: Any) -> str:
    """Fill in what stands in a table of trials: every cause, every metric with its unit."""
    if page.file.src_uri != "columns.md":
        return markdown
    metrics = {re.sub(r"_at_\d+$", "_at_N", metric.column): metric for metric in METRICS}
    for mark, rows in {
        "<!-- causes of triggers -->": [f"| `{cause.name}` | {cause.label} |" for cause in causes.POLICY],
        "<!-- causes of the pilot -->": [f"| `{cause.name}` | {cause.label} |" for cause in causes.PILOT],
        "<!-- metrics -->": [_metric_row(column, metric) for column, metric in metrics.items()],
    }.items():
        markdown = markdown.replace(mark, "\n".join(rows))
    return markdown


def _metric_row(column: str, metric: Metric) -> str:
    title = re.sub(r"\d+ iterations", "N iterations", metric.title or metric.column).replace("|", r"\|")
    unit = "share, 0 to 1" if metric.scale == 100.0 else metric.unit
    better = {1: "more", -1: "less", 0: ""}[metric.better]
    return f"| `{column}` | {title} | {unit} | {better} | {metric.missing} |"


def _study_page(folder: Path) -> str:
    """Command, verdicts, tables and figures of a study, in the order in which its report has them."""
    study: dict[str, Any] = json.loads((folder / "study.json").read_text(encoding="utf-8"))
    lines = [f"# {study['title'] or folder.name}", "", *_runs(folder), ""]
    claims = [folder / "claims.md"] if (folder / "claims.md").exists() else []
    for file in [*claims, *_in_order(folder / "tables", "*.md", study["report"].get("tables", []))]:
        lines += [re.sub(r"(?m)^### ", "## ", file.read_text(encoding="utf-8")), ""]
    for figure in _in_order(folder / "figures", "*.png", study["report"].get("figures", [])):
        name = figure.stem.replace("_", " ")
        lines += [f"## {name}", "", f"![{name}](figures/{figure.name})", ""]
    return "\n".join(lines)


def _runs(folder: Path) -> list[str]:
    """What was typed, how long it took, where: a line for each command that flew into a folder."""
    runs = json.loads((folder / "run.json").read_text(encoding="utf-8"))["runs"]
    typed: dict[str, list[dict[str, Any]]] = {}
    for run in [run for run in runs if run["flown"]] or runs:
        typed.setdefault(shlex.join(run["command"]), []).append(run)
    return [
        f"- `python -m uavexp {words}`: {sum(run['flown'] for run in same)} trials"
        f" in {sum(run['wall_s'] for run in same) / 60.0:.0f} min, {same[-1]['machine']},"
        f" commit `{(same[-1]['commit'] or 'unknown')[:7]}`"
        for words, same in typed.items()
    ]


def _in_order(folder: Path, pattern: str, declared: list[Any]) -> list[Path]:
    """Files of a folder as the report declares them, the others behind."""
    names = []
    for item in declared:
        kind, options = next(iter(item.items())) if isinstance(item, dict) else (item, {})
        names.append(options.get("name", kind.rpartition(".")[2]))
    place = {name: number for number, name in enumerate(names)}
    return sorted(folder.glob(pattern), key=lambda file: (place.get(file.stem, len(place)), file.stem))
