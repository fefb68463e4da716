"""Imports point one way (DESIGN.md): read from the source, nothing is imported."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from uavexp.config.build import GROUPS
from uavexp.paths import PACKAGE

# a module may import modules of lower layers; within a layer, freely where it says so
LAYERS = (
    {"arrays", "errors", "interrupts", "kernel_cache", "memory"},
    {"field", "space", "trajectory", "pace", "seeding", "paths", "frames", "geometry", "o3d"},
    {"types", "scan", "log", "causes", "parameters", "map_change", "path_clearance", "answers", "network"},
    {"braking", "triangle_grid", "bodies", "scene", "formats", "policy"},
    {"cloud"},
    {"roles", "metrics", "inspection"},
    {"recorder", "map_grid", "seen_share", "passage", "pilot", "motion", "finite", "trial"},
    {"config"},
    {"flight", "__init__", "env"},
    {"store", "check"},
    {"export"},
    {"report"},
    {"study"},
    {"show", "judge", "replay"},
    {"sweep"},
    {"cli"},
    {"tune"},
    {"results", "benchmark"},
    {"__main__"},
)
HYDRA = ("hydra", "omegaconf")


def modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def name_of(file: Path) -> str:
    parts = file.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" and len(parts) > 2 else parts)


def imports(file: Path) -> Iterator[str]:
    """Imported module names; what is imported for type checking alone counts like the rest."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: relative import"
            folder = PACKAGE.parent / str(node.module).replace(".", "/")
            inner = [alias.name for alias in node.names if (folder / f"{alias.name}.py").is_file()]
            yield from (f"{node.module}.{name}" for name in inner)
            if len(inner) < len(node.names):
                yield str(node.module)


def part_of(module: str) -> str:
    words = module.split(".")
    part = words[1] if len(words) > 1 else "__init__"
    if words[-1] == "__main__":  # a command stands above all that it calls
        return "__main__"
    return "roles" if part in GROUPS and part != "pilot" else part  # the pilot asks other roles


def layer_of(module: str) -> int:
    found = [index for index, layer in enumerate(LAYERS) if part_of(module) in layer]
    assert found, f"{module} has no layer: add it to LAYERS"
    return found[0]


@pytest.mark.parametrize("file", modules(), ids=name_of)
def test_a_module_imports_only_what_lies_below(file: Path) -> None:
    here = name_of(file)
    if part_of(here) == "__init__":
        return  # what it imports is for type checking alone
    for module in imports(file):
        if module.split(".")[0] != "uavexp" or module == "uavexp":
            continue
        above = layer_of(module) > layer_of(here)
        assert not above, f"{here} imports {module}, which lies above it"


@pytest.mark.parametrize("file", modules(), ids=name_of)
def test_a_role_imports_another_role_through_its_base_or_pure_modules(file: Path) -> None:
    here = name_of(file).split(".")
    if here[1] not in GROUPS:
        return
    options = {
        f"uavexp.{group}.{item.stem}"
        for group in GROUPS
        for item in (PACKAGE.parent / "conf" / group).glob("*.yaml")
    }
    for module in imports(file):
        foreign = (
            module.startswith("uavexp.")
            and module.split(".")[1] in GROUPS
            and module.split(".")[1] != here[1]
        )
        assert not (foreign and module in options), f"{'.'.join(here)} imports the option {module}"


@pytest.mark.parametrize("file", modules(), ids=name_of)
def test_hydra_stays_on_the_command_line(file: Path) -> None:
    users = [module for module in imports(file) if module.split(".")[0] in HYDRA]
    assert not users or part_of(name_of(file)) in ("config", "cli"), f"{file} imports {users}"


@pytest.mark.parametrize("file", modules(), ids=name_of)
def test_open3d_comes_through_its_loader(file: Path) -> None:
    users = [module for module in imports(file) if module.split(".")[0] == "open3d"]
    assert not users or file.name == "o3d.py"


def test_there_is_no_cycle() -> None:
    graph = {
        name_of(file): {module for module in imports(file) if module.startswith("uavexp.")}
        for file in modules()
        if name_of(file) != "uavexp.__init__"
    }

    def visit(module: str, path: tuple[str, ...]) -> None:
        assert module not in path, " -> ".join([*path, module])
        if module not in done:
            for inner in sorted(graph.get(module, ())):
                visit(inner, (*path, module))
            done.add(module)

    done: set[str] = set()
    for module in sorted(graph):
        visit(module, ())
