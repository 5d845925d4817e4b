"""Operations on macros: record, play, list and change them."""

from __future__ import annotations

from multidrop.shell.operations import arguments
from multidrop.shell.operations.operation import Operation, typed

MACROS = Operation(
    usage="/macros",
    help="""List the macros: name, key and page, number of lines, values, note.

    Macros beside a project, in the folder `macros` of the current folder, come before the user's own.
    """,
    work="macros:macros",
    immediate=True,
    command="macro list",
    meaning="list the macros: name, key, number of lines, values, note",
    run="macros.list_",
    examples=["macro list"],
)
MACRO = Operation(
    usage=(
        "/macro show MACRO | edit MACRO | describe MACRO TEXT ... | rename MACRO NAME | copy MACRO NAME "
        "[--project] | delete MACRO | import FILE [--force] | export FILE [MACRO ...]"
    ),
    help="""Show, describe, rename, copy or delete a macro; import or export function-key strings.

    Remarks in a file stay, whatever else of it changes. Without a screen `multidrop macro edit` in another
    terminal opens an editor.
    """,
    work="macros:macro",
    words={
        "show": "print its file",
        "edit": "open its file in the editor of the screen",
        "describe": "change its note",
        "rename": "give it another name",
        "copy": "copy it under another name",
        "--project": "into the folder macros of the current folder",
        "delete": "delete its file",
        "import": "make macros of function-key strings, one a line: F2 STRING ; comment",
        "--force": "in place of the macros of these names",
        "export": "write macros as function-key strings",
    },
    immediate=True,
)
MACRO_SHOW = Operation(
    command="macro show",
    meaning="print a macro's file",
    run="macros.show",
    examples=["macro show shuttle"],
    arguments={"NAME": None},
)
PLAY = Operation(
    usage="/play MACRO [NAME=VALUE ...] [--times N|forever] [--fast] | stop [MACRO]",
    help="""Play a macro; {NAME} in its lines takes the given value. The first failure ends it.

    A role of the macro takes the name of an open bus. What is missing is asked for. `/play stop` ends what plays and
    stops the drives that it set in motion; its on_early_end lines follow. After Ctrl+X they do not.
    """,
    work="macros:play",
    words={
        "stop": "end what plays, and stop what it set in motion",
        "--times": "play several rounds",
        "forever": "play until it is ended",
        "--fast": "leave out the recorded pauses",
    },
    recorded="typed",
    concurrent=True,
    command="macro play",
    meaning="play a macro: once, several rounds, or until it is interrupted",
    run="macros.play",
    examples=[
        "macro play shuttle --on press --set STEPS=51200",
        "macro play shuttle --role gantry=/dev/ttyUSB0 --times 10 --junit report.xml",
        "macro play shuttle --on sim:cell.toml --fast --times forever",
    ],
    arguments={
        "NAME": None,
        "--on URL ...": "what to open; may be repeated",
        "--role NAME=URL ...": typed(
            "open a URL as the bus NAME, which lines address as @NAME:ADDR; may be repeated", type=arguments.role_url
        ),
        "--set NAME=VALUE ...": typed("the value of {NAME} in a line", type=arguments.named_value),
        "--times N|forever": typed("play N rounds, or until it is interrupted", default=1, type=arguments.rounds),
        "--fast": "leave out the recorded pauses",
        "--json": arguments.SUMMED,
        "--junit FILE": arguments.JUNIT,
        "--yes": arguments.YES,
        "--beyond": arguments.BEYOND,
    },
)
MACRO_EDIT = Operation(
    command="macro edit",
    meaning="open a macro's file in the editor of VISUAL or EDITOR; it changes only once the whole text is right",
    run="macros.change",
    examples=["macro edit shuttle"],
    arguments={"NAME": None},
)
MACRO_DESCRIBE = Operation(
    command="macro describe",
    meaning="change a macro's note",
    run="macros.change",
    examples=['macro describe shuttle "ten turns and back"'],
    arguments={"NAME": None, "text=TEXT ...": "the note"},
)
MACRO_RENAME = Operation(
    command="macro rename",
    meaning="give a macro another name",
    run="macros.change",
    examples=["macro rename shuttle ten-turns"],
    arguments={"NAME": None, "NEW": "the other name"},
)
MACRO_COPY = Operation(
    command="macro copy",
    meaning="copy a macro; --project: into the folder macros of the current folder",
    run="macros.change",
    examples=["macro copy shuttle shuttle --project"],
    arguments={"NAME": None, "NEW": "the other name", "--project": "into the folder macros of the current folder"},
)
MACRO_DELETE = Operation(
    command="macro delete",
    meaning="delete a macro; asks first",
    run="macros.change",
    examples=["macro delete shuttle"],
    arguments={"NAME": None, "--yes": arguments.YES},
)
KEY = Operation(
    usage="/key F2..F12 MACRO|off [--page PAGE]",
    help="""Assign a macro to a function key, or free the key.

    Keys are in pages, each a number or a word; the default is 1. Only key and page in the macro's file change.
    """,
    work="macros:key",
    words={"off": "free the key", "--page": "on another page of keys"},
    immediate=True,
    command="macro key",
    meaning="put a macro on a function key, or free the key",
    run="macros.change",
    examples=["macro key F3 shuttle", "macro key F3 shuttle --page 2", "macro key F3 off"],
    arguments={
        "key=F2..F12": typed(None, type=arguments.function_key),
        "NAME|off": "off: free the key",
        "--page PAGE": typed("a number or a word (default: 1)", default="1"),
    },
)
MACRO_IMPORT = Operation(
    command="macro import",
    meaning="make macros of a vendor's function-key strings, one a line: F2 STRING ; comment",
    run="macros.change",
    examples=["macro import keys.txt"],
    arguments={
        "FILE": "function-key strings, one a line: F2 STRING ; comment (-: standard input)",
        "--force": "replace the macros of these names",
    },
)
MACRO_EXPORT = Operation(
    command="macro export",
    meaning="write macros to a new file of a vendor's function-key strings",
    run="macros.change",
    examples=["macro export keys.txt", "macro export keys.txt f2 shuttle"],
    arguments={"FILE": "the new file (-: standard output)", "[NAME ...]": "a macro (default: those on keys)"},
)
RECORD = Operation(
    usage="/record [MACRO [--replace] | stop [--waits]]",
    help="""Record the typed lines as a macro, until `/record stop`.

    Without a word it shows the recording. With `--replace` it replaces the macro of that name and keeps its key. At the
    end, waits are offered in place of long pauses: for the end of a motion, an input, or a text that was printed.
    """,
    work="macros:record",
    words={
        "stop": "end, and save it",
        "--replace": "in place of the macro of that name",
        "--waits": "put waits in place of long pauses",
    },
    immediate=True,
)
MACRO_GROUP = Operation(command="macro", meaning="list, show, play, change, import and export macros", urls=True)
