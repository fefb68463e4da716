"""Shell completion, asked for as Hydra's users ask: `eval "$(uavexp -sc install=bash)"`."""

from __future__ import annotations

from pathlib import Path

from uavexp.config.experiment import list_experiments
from uavexp.config.options import EXPERIMENT_GROUP, list_options, read_option
from uavexp.errors import ConfigError
from uavexp.paths import conf_folder

_FLAGS = ("--help", "--multirun", "--cfg", "--debug", "--info", "--version", "--config-dir", "--config-name")
_OWN = ("seed=", "out=", f"{EXPERIMENT_GROUP}=", "tune")
_BASH = """\
_uavexp() {
  local typed="${COMP_LINE:0:COMP_POINT}" word
  word="${typed##* }"
  COMPREPLY=( $(uavexp -sc query="$word" 2>/dev/null) )
  if [[ "$word" == *=* && "$COMP_WORDBREAKS" == *=* ]]; then
    COMPREPLY=( "${COMPREPLY[@]#"${word%%=*}="}" )  # bash has taken the word apart at its =
  fi
}
complete -o nospace -o default -F _uavexp uavexp
"""
_SCRIPTS = {
    "bash": _BASH,
    "zsh": f"autoload -Uz bashcompinit && bashcompinit\n{_BASH}",
    "fish": "complete -c uavexp -a '(uavexp -sc query=(commandline -ct))'\n",
}


def completion(request: str, folder: Path | None = None) -> str:
    """Answer a `-sc` request: a shell's script, or the words that a word may become.

    Args:
        request: `install=bash`, `uninstall=bash`, `query=WORD`.
        folder: of `--config-dir`.

    Raises:
        ConfigError: another request.
    """
    what, _, value = request.partition("=")
    if what == "query":
        return "".join(f"{word}\n" for word in candidates(value, folder))
    if what in ("install", "uninstall") and value in _SCRIPTS:
        if what == "install":
            return _SCRIPTS[value]
        return "complete -e -c uavexp\n" if value == "fish" else "complete -r uavexp\n"
    shells = "|".join(_SCRIPTS)
    raise ConfigError(f"-sc {request}: type -sc install={shells}, uninstall={shells} or query=WORD")


def candidates(word: str, folder: Path | None = None) -> list[str]:
    """What a word that is being typed may become: groups, options, parameters, experiments, flags."""
    options = list_options([conf_folder(), *([folder] if folder else [])])
    key, equals, value = word.partition("=")
    if equals:
        names = list_experiments(folder) if key == EXPERIMENT_GROUP else options.get(key, {})
        *before, last = value.split(",")  # a grid: the word goes on behind its last comma
        begin = "".join(f"{item}," for item in before)
        return [f"{key}={begin}{name}" for name in names if name.startswith(last)]
    every = [*_FLAGS, *_OWN, *(f"{group}=" for group in options)]
    if "." in word:
        every += [f"{name}=" for name in _parameters(options)]
    return sorted({item for item in every if item.startswith(word)})


def _parameters(options: dict[str, dict[str, Path]]) -> list[str]:
    return [
        f"{group}.{parameter.name}"
        for group, files in options.items()
        for file in files.values()
        for parameter in read_option(file).parameters
    ]
