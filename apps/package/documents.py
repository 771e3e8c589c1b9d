#!/usr/bin/env python3
"""Man pages and completions for bash and zsh, from what `scanshade help --json` says.

    scanshade help --json | python3 apps/package/documents.py FOLDER

writes FOLDER/man/*.1.gz, FOLDER/bash/scanshade and FOLDER/zsh/_scanshade. Same input, same bytes.
"""

import gzip
import json
import sys
import textwrap
from pathlib import Path


# ------------------------------------------------------------------------------------------------- man pages


def roff(text):
    """The text as troff sees it: no command, no escape, and hyphens that can be searched for."""
    text = text.replace("\\", "\\e").replace("-", "\\-")
    return "\n".join("\\&" + line if line.startswith((".", "'")) else line for line in text.split("\n"))


def heading(title, text, version):
    return [f'.TH {title} 1 "" "scanshade {version}" "User Commands"', ".SH NAME", text]


def limits(flag):
    """What a value may be: "m, 0 .. 100", "one of a, b"."""
    parts = []
    if flag["kind"] != "switch" and flag["default"] not in ("", None):
        parts.append(f"default {flag['default']}")
    if flag["kind"] == "choice":
        parts.append("one of " + ", ".join(flag["choices"]))
    elif flag["kind"] in ("integer", "number"):
        low, high = flag.get("low"), flag.get("high")
        bounds = f"{low:g} .. {high:g}" if None not in (low, high) else ""
        bounds = bounds or (f"at least {low:g}" if low is not None else f"at most {high:g}" if high is not None else "")
        parts += [p for p in (flag["unit"], bounds) if p]
    return f" [{'; '.join(parts)}]" if parts else ""


def flag_lines(flag):
    names = [f"\\fB\\-{flag['short']}\\fR"] if "short" in flag else []
    names.append(f"\\fB\\-\\-{roff(flag['name'])}\\fR")
    value = "" if flag["kind"] == "switch" else f" \\fI{flag['kind'].upper()}\\fR"
    return [".TP", ", ".join(names) + value, roff(flag["help"] + limits(flag))]


def words_of(command):
    words = command.get("words")
    if not words:
        return ""
    name = f"\\fI{roff(words['name'])}\\fR" + ("..." if words["at_most"] > 1 else "")
    return " " + (name if words["at_least"] > 0 else f"[{name}]")


def exit_status(program):
    lines = [".SH EXIT STATUS"]
    for code in program["exit_codes"]:
        lines += [".TP", f"\\fB{code['code']}\\fR", roff(code["meaning"])]
    return lines


def program_page(program):
    lines = heading("SCANSHADE", f"scanshade \\- {roff(program['summary'])}", program["version"])
    lines += [".SH SYNOPSIS", "\\fBscanshade\\fR \\fICOMMAND\\fR [\\fIwords\\fR] [\\fIflags\\fR]", ".SH COMMANDS"]
    for command in program["commands"]:
        lines += [".TP", f"\\fB{roff(command['name'])}\\fR", roff(command["summary"])]
    lines += [
        ".PP",
        "\\fBscanshade help\\fR \\fICOMMAND\\fR shows the flags of one, \\fBscanshade help \\-\\-json\\fR all of all.",
    ]
    lines += exit_status(program) + [".SH SEE ALSO"]
    pages = [f".BR scanshade\\-{roff(command['name'])} (1)" for command in program["commands"]]
    return lines + [page + "," for page in pages[:-1]] + pages[-1:]


def command_page(program, command):
    name = f"scanshade-{command['name']}"
    lines = heading(name.upper(), f"{roff(name)} \\- {roff(command['summary'])}", program["version"])
    lines += [".SH SYNOPSIS", f"\\fBscanshade {roff(command['name'])}\\fR{words_of(command)} [\\fIflags\\fR]"]
    if "words" in command:
        lines += [".SH ARGUMENTS", ".TP", f"\\fI{roff(command['words']['name'])}\\fR", roff(command["words"]["help"])]
    if command["flags"]:
        lines.append(".SH OPTIONS")
    stage = None
    for flag in command["flags"]:
        if flag["stage"] != stage:
            stage = flag["stage"]
            lines.append(f".SS {roff(stage)}")
        lines += flag_lines(flag)
    return lines + exit_status(program) + [".SH SEE ALSO", ".BR scanshade (1)"]


# ----------------------------------------------------------------------------------------------- completions


def flags_of(command):
    for flag in command["flags"]:
        yield f"--{flag['name']}", flag
        if "short" in flag:
            yield f"-{flag['short']}", flag


def bash(program):
    commands = " ".join([c["name"] for c in program["commands"]] + ["help", "--version"])
    lines = [
        "# bash completion for scanshade",
        "_scanshade() {",
        "    local cur prev words cword split",
        "    _init_completion -s || return",
        f'    local commands="{commands}" command=${{words[1]}} flags=""',
        "    if [[ $cword -eq 1 || ($cword -eq 2 && $command == help) ]]; then",
        '        mapfile -t COMPREPLY < <(compgen -W "$commands" -- "$cur")',
        "        return",
        "    fi",
        '    case "$command $prev" in',
    ]
    for command in program["commands"]:
        for name, flag in flags_of(command):
            if flag["kind"] == "choice":
                choices = " ".join(flag["choices"])
                lines += [
                    f'        "{command["name"]} {name}")',
                    f'            mapfile -t COMPREPLY < <(compgen -W "{choices}" -- "$cur")',
                    "            return ;;",
                ]
            elif flag["kind"] in ("integer", "number"):
                lines.append(f'        "{command["name"]} {name}") return ;;')
    lines += ["    esac", '    if [[ $split == true ]]; then _filedir; return; fi', '    case "$command" in']
    for command in program["commands"]:
        lines.append(f'        {command["name"]}) flags="{" ".join(name for name, _ in flags_of(command))}" ;;')
    lines += [
        "    esac",
        "    if [[ $cur == -* ]]; then",
        '        mapfile -t COMPREPLY < <(compgen -W "$flags" -- "$cur")',
        "    else",
        "        _filedir",
        "    fi",
        "}",
        "complete -F _scanshade scanshade",
    ]
    return lines


def quoted(text):
    """Within an argument of zsh's _arguments, between single quotes."""
    for mark in "\\[]:":
        text = text.replace(mark, "\\" + mark)
    return text.replace("'", "'\\''")


def zsh_flag(name, flag):
    if flag["kind"] == "switch":
        return f"'{name}[{quoted(flag['help'])}]'"
    what = quoted(flag["unit"] or flag["kind"])
    action = {"choice": f"({' '.join(flag.get('choices', []))})", "text": "_files"}.get(flag["kind"], "")
    return f"'{name}=[{quoted(flag['help'])}]:{what}:{action}'"


def zsh(program):
    lines = ["#compdef scanshade", "", "_scanshade() {", "  local -a commands", "  commands=("]
    lines += [f"    '{c['name']}:{quoted(c['summary'])}'" for c in program["commands"]]
    lines += ["    'help:the commands, or the flags of one'", "  )"]
    lines += [
        "  if (( CURRENT == 2 )) || { (( CURRENT == 3 )) && [[ $words[2] == help ]] }; then",
        "    _describe command commands",
        "    return",
        "  fi",
        "  local command=$words[2]",
        "  shift words",
        "  (( CURRENT-- ))",
        "  case $command in",
    ]
    for command in program["commands"]:
        lines.append(f"    {command['name']})")
        specs = [zsh_flag(name, flag) for name, flag in flags_of(command) if name.startswith("--")]
        lines.append("      _arguments -S \\\n        " + " \\\n        ".join(specs + ["'*:file:_files'"]) + " ;;")
    return lines + ["  esac", "}", "", '_scanshade "$@"']


# ---------------------------------------------------------------------------------------------------- files


def write(path, lines, packed=False):
    path.parent.mkdir(parents=True, exist_ok=True)
    data = ("\n".join(lines) + "\n").encode()
    path.write_bytes(gzip.compress(data, 9, mtime=0) if packed else data)


def main():
    if len(sys.argv) != 2:
        raise SystemExit(textwrap.dedent(__doc__).strip())
    program, out = json.load(sys.stdin), Path(sys.argv[1])
    write(out / "man/scanshade.1.gz", program_page(program), packed=True)
    for command in program["commands"]:
        write(out / f"man/scanshade-{command['name']}.1.gz", command_page(program, command), packed=True)
    write(out / "bash/scanshade", bash(program))
    write(out / "zsh/_scanshade", zsh(program))


if __name__ == "__main__":
    main()
