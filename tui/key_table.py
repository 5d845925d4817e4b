"""The one table of keys: what each page and box is for, its keys, and what they do there.

Bindings, footers, the keys named in boxes, F1 and the table in docs/screen.md are made from it, so none of them can
name a key that does nothing. A key has one word, the same wherever it works (docs/decisions/0099); its line says what
that is here.

To add a key, add a `Key` to the sheet of its page, and its action to the page.
"""

from __future__ import annotations

from textual.binding import Binding, BindingType

from multidrop.tui.sheets import NONE, Key, Sheet

STOP = Key("ctrl+x", "", "STOP ALL: drives, macros, scripts; from anywhere", "STOP ALL")
"""The stop: it is found below every binding."""
_STEP = Key("up / down", "step(-1) / step(1)", "the row above, the row below", "choose", first=True)
_LEAP = Key("pageup / pagedown", "step(-10) / step(10)", "ten rows up, ten rows down", first=True)
_LEAVE = Key("escape", "leave", "close", "close")

SHEETS: dict[str, Sheet] = {
    "app": Sheet(
        "everywhere",
        "",
        {
            "Everywhere": (
                Key("ctrl+q", "quit", "quit; asks if something moves", "quit", "quit"),
                Key("ctrl+c", "act.explain", "copy what is selected"),
            ),
            "Pages": (
                Key(
                    "ctrl+a",
                    "act.page_key('drives')",
                    "every drive of every line, the worst first; in a line: its start",
                    "all drives",
                    "page-drives",
                ),
                Key("ctrl+g", "act.page_key('plot')", "curves over time", "plots", "page-plot"),
                Key("ctrl+n", "act.page_key('controls')", "jog, move, home, stop", "controls", "page-controls"),
                Key("ctrl+l", "act.page_key('parameters')", "every setting", "parameters", "page-parameters"),
                Key(
                    "ctrl+e",
                    "act.page_key('program')",
                    "edit, check, download and run a program",
                    "edit",
                    "page-program",
                ),
                Key("", "act.page_key('macros')", "play, record, put on keys", "", "page-macros"),
                Key("", "act.page_key('why')", "what is wrong with the selected drive", "", "page-why"),
                Key("", "act.page_key('traffic')", "the bytes of the line", "", "page-traffic"),
            ),
        },
    ),
    "screen": Sheet(
        "everywhere",
        "",
        {
            "Everywhere": (
                Key("f1", "act.help", "help for where you are", "help", "help"),
                Key("ctrl+p", "act.palette", "everything by name: type some letters of it", "everything", "palette"),
                Key("ctrl+o", "act.choose_drive", "choose the drive that plain text goes to", "drive", "drive"),
                Key("", "act.units", "positions in units, or in the drives' own numbers", "", "units"),
            ),
        },
        ("app",),
    ),
    "main": Sheet(
        "main screen",
        "Type a line and press Enter: it goes to the selected drive, in the drive's own language. A line that begins "
        "with / is for multidrop itself, and /help lists those. The transcript shows what was sent, and what the "
        "drives print. The panels show the selected drive and the others of its line. ^X stops every drive from "
        "here and from every page.",
        {
            "The line": (
                Key("enter", "", "send the line"),
                Key("tab / shift+tab", " / ", "the next completion, the one before"),
                Key("up / down", " / ", "lines typed before that begin with what is typed"),
                Key("ctrl+r", "act.search_history", "search the lines typed before; again: older", "lines", "history"),
                Key("home", "act.start_of_line", "the start of the line; there: all drives, as ^A", first=True),
                Key("escape", "act.end_tour", "close the list of completions, or end the tour", first=True),
            ),
            "The transcript": (
                Key("ctrl+f", "find", "search the transcript; again: older", "find", "find"),
                Key("pageup", "look(-1)", "look back in the transcript", "", "look-back"),
                Key("pagedown", "look(1)", "look on in the transcript", "", "look-on"),
                Key("ctrl+home", "look_end(False)", "the beginning of the transcript", "", "oldest"),
                Key("ctrl+end", "look_end(True)", "follow the transcript again", "", "newest"),
                Key("ctrl+b,insert", "pause", "stop the scrolling, or let it go on", "hold", "pause"),
                Key("ctrl+s", "act.begin_line('/save ')", "save the transcript: type a file name", "save", "save"),
                Key("shift+up / shift+down", "pick(-1) / pick(1)", "pick lines of the transcript to copy", first=True),
                Key("", "pick(0)", "pick lines of the transcript to copy", "", "pick"),
                Key("", "act.run_line('/times')", "times of the lines in another form", "", "times"),
                Key("", "act.run_line('/filter mine')", "show only what you typed, and its replies", "", "filter-mine"),
                Key("", "act.run_line('/filter off')", "show all lines", "", "filter-off"),
                Key("", "act.run_line('/hex')", "the bytes of the selected line beside its lines, or not", "", "hex"),
                Key("", "act.log", "begin the session log, or end it", "", "log"),
                Key("", "act.repaint", "paint the whole screen again", "", "repaint"),
            ),
            "Lines of drives": (
                Key("ctrl+pageup", "act.bus(-1)", "the line before", "", "tab-before"),
                Key("ctrl+pagedown", "act.bus(1)", "the next line", "", "tab-after"),
                Key("alt+1..9,ctrl+1..9", "act.bus_number({})", "line {}", "", "tab-{}"),
                Key("ctrl+shift+pageup", "act.run_line('/tab left')", "this tab to the left", "", "tab-left"),
                Key("ctrl+shift+pagedown", "act.run_line('/tab right')", "this tab to the right", "", "tab-right"),
                Key("", "act.twin", "a twin beside each drive of the line, or none", "", "twin"),
                Key("", "act.split", "split the screen; then: type to the other half", "", "split"),
            ),
            "Macros": (
                Key("f2..12", "act.play('F{}')", "play the macro on the key", "", "play-f{}"),
                Key("ctrl+k", "act.macro_page", "the next page of macros on F2 .. F12", "", "macro-page"),
            ),
        },
        ("screen",),
        ("everything", "drive", "all drives", "plots", "parameters", "*", "quit"),
    ),
    "page": Sheet("everywhere", "", {"Everywhere": (Key("escape", "leave", "go back", "back"),)}, ("screen",)),
    "drives": Sheet(
        "all drives",
        "Every drive of every line has a row, and the worst comes first. A drive that is lost, silent or in error is "
        "above those that move, and those are above the ones at rest. What you type keeps only the rows that have it: "
        "a bus, an address, a name, a state. Enter selects the drive and goes back, or shows why it is in trouble.",
        {"Rows": (_STEP, _LEAP, Key("enter", "", "select the drive; of one in trouble: show why", "select"))},
        ("page",),
    ),
    "why": Sheet(
        "why",
        "What is known of the trouble of the selected drive. It shows the error with its meaning, the program, what "
        "was sent last, and the last 20 s. Nothing is read for it that a reading would clear. The keys below help "
        "further, and the page shows a line before it is sent.",
        {
            "What helps": (
                Key("r", "read_error", "read the number of the error, which clears it: Enter sends it", "read"),
                Key("t", "act.page('traffic')", "the bytes of its line", "traffic"),
                Key("enter", "go", "send the line that is shown"),
            )
        },
        ("page",),
        ("back", "*", "controls", "edit", "everything"),
    ),
    "plot": Sheet(
        "plots",
        "The curves of the selected drive, or of those that you choose. The picture runs with the time, and Space "
        "holds it while the drives go on. Two cursors read values and differences. A trigger stops the "
        "picture around the moment at which a curve crosses a level. /plot names what is plotted, and writes it "
        "to a file or to rerun.",
        {
            "Time and values": (
                Key("space", "pause", "hold the picture, or let it run", "hold"),
                Key("left / right", "cursor(-1) / cursor(1)", "the cursor", "cursor"),
                Key("pageup / pagedown", "cursor(-20) / cursor(20)", "the cursor in larger steps"),
                Key("x", "other", "the second cursor here; then change between the two", "cursor 2"),
                Key("plus,equals_sign / minus", "shorter(1) / shorter(-1)", "a shorter time, a longer one", "time"),
                Key("up / down", "closer(1) / closer(-1)", "magnify the values, or show more of them", "values"),
                Key("0", "automatic", "all of it again, as it runs, without a trigger", "reset"),
            ),
            "Trigger": (
                Key("g", "trigger", "stand at each edge: type curve, rise or fall, level, share before it", "trigger"),
                Key("j", "single", "stand at the next edge only; again: wait for one more", "single"),
            ),
            "What is plotted": (
                Key("1..9", "drive({})", "a drive of the line by its number, or not", "drive"),
                Key("a", "drive(0)", "all drives of the line", "all"),
                Key("v", "hide('velocity')", "velocity, or not", "velocity"),
                Key("p", "hide('position')", "position, or not", "position"),
                Key("w", "difference", "the differences from the twins, or not", "twin"),
                Key("s", "apart", "charts of its own for each drive, or all in one", "split"),
            ),
            "Elsewhere": (
                Key("ctrl+s", "save", "save what is visible: type a name that ends in .csv or .rrd", "save"),
                Key("o", "stream", "serve the plot for rerun, or end that", "rerun"),
                Key("c", "copy", "copy the command of your desk for rerun", "copy"),
                Key("ctrl+g", "beside", "the plot beside the transcript, or not", "plots"),
            ),
        },
        ("page",),
    ),
    "macros": Sheet(
        "macros",
        "Each macro has a row with its key, its length and its note, and the chosen one shows its lines below. Type to "
        "narrow the list. Enter plays it, and the row shows the step. A recording keeps what you type, with the pauses "
        "between the lines.",
        {
            "The chosen macro": (
                _STEP,
                _LEAP,
                Key("enter", "", "play it, once a press", "play"),
                Key("ctrl+e", "edit", "edit its file", "edit"),
                Key("ctrl+k", "key", "put it on a key", "key"),
                Key("delete", "delete", "delete its file; asks", "delete", first=True),
                Key("ctrl+b,insert", "end", "end it, if it plays", "hold"),
            ),
            "Macros": (Key("", "act.record", "record one, or end the recording", "record a macro"),),
        },
        ("page",),
        ("back", "everything", "*"),
    ),
    "program": Sheet(
        "program",
        "A program file in an editor, checked while you type. ^D downloads it after a backup, and reads it back. "
        "^R lists the lines that run, trace and break it, each as it is sent. The sign in front of a line is where the "
        "drive's program stands. What is not saved has a copy that is offered again.",
        {
            "The file": (
                Key("ctrl+s", "save", "save the file", "save"),
                Key("ctrl+e", "open", "another file, a new one, or what the drive holds", "edit"),
                Key("ctrl+f", "next_problem", "the next error in it", "find"),
            ),
            "The drive": (
                Key("ctrl+d", "download", "send it to the drive: shows what that does, and asks", "download"),
                Key("ctrl+r", "run", "run, trace or step from a label; go on, break, list", "lines"),
                Key("ctrl+t", "step", "execute one line of a program that waits", "step"),
                Key("ctrl+b,insert", "break", "hold at the line of the cursor: its break point, or none", "hold"),
            ),
            "The text": (
                Key("ctrl+z / ctrl+y", " / ", "take the last change back, do it again"),
                Key("ctrl+home / ctrl+end", " / ", "the beginning of the text, its end"),
                Key("tab / shift+tab", " / ", "indent, or less"),
            ),
        },
        ("page",),
        ("back", "*", "drive", "everything"),
    ),
    "parameters": Sheet(
        "parameters",
        "Every setting of the selected drive, read when it is opened. Type to narrow the list: a name, a value, a "
        "meaning. Enter edits the chosen one: the value is checked, the lines are shown, and a second Enter sends "
        "them. The table is compared with the defaults, with a file, or with another drive, and marks what differs.",
        {
            "Settings": (
                _STEP,
                _LEAP,
                Key("enter", "", "edit the chosen one; then send the lines that are shown", "edit"),
                Key("ctrl+s", "save", "the drive keeps its settings; asks", "save"),
                Key("", "read", "every setting; changes nothing", "read again"),
            ),
            "Compare": (
                Key("", "defaults", "or with nothing", "compare with the defaults"),
                Key("", "ask('file')", "one of /params backup", "compare with a file"),
                Key("", "ask('drive')", "whose settings were read", "compare with another drive"),
                Key("", "differing", "or everything", "show only what differs"),
                Key("", "variables", "of the program alone, or everything", "show the variables"),
            ),
        },
        ("page",),
        ("back", "everything", "*"),
    ),
    "controls": Sheet(
        "controls",
        "Moves by keys: each control shows the line that it sends. One press of an arrow is one step, and it counts "
        "only while the drive is known to rest. A letter alone moves nothing: the page shows the line, and Enter sends "
        "it. Space stops the axis, also while a number is typed. To leave the page stops nothing.",
        {
            "Jog": (
                Key("left / right", "jog(-1) / jog(1)", "one step in minus, in plus: moves at once", "jog"),
                Key("up / down", "step(1) / step(-1)", "a longer step, a shorter one", "step"),
                Key("l", "ask('l')", "type the length of a step", "length"),
                Key("tab", "axis", "the next axis", first=True),
            ),
            "Move": (
                Key("m", "ask('m')", "move to a position: number, Enter", "move to"),
                Key("b", "ask('b')", "move by a distance: number, Enter", "move by"),
                Key("h", "home", "home: + or -, Enter", "home"),
                Key("plus / minus", "toward('+') / toward('-')", "the direction of the homing"),
                Key("enter", "go", "send the line that is shown"),
            ),
            "Stop and current": (
                Key("space", "do('space')", "stop this axis, at once", "stop axis"),
                Key("e", "do('e')", "current in the motor: Enter sends it", "enable"),
                Key("d", "do('d')", "no current, nothing holds the load: Enter sends it", "disable"),
            ),
        },
        ("page",),
    ),
    "traffic": Sheet(
        "traffic",
        "The bytes of the selected line, both ways, each with its time, its text and its hex. The newest is at the "
        "bottom, and the view follows it until you look back. What multidrop reads by itself is hidden until you ask.",
        {
            "The view": (
                Key("space", "pause", "hold the view, or follow again", "hold"),
                Key("up / down", "look(-1) / look(1)", "one piece back, one on", "look back", first=True),
                Key("pageup / pagedown", "page(-1) / page(1)", "a page back, a page on", first=True),
                Key("home,ctrl+home", "look(-1000000)", "the oldest", first=True),
                Key("end,ctrl+end", "follow", "follow the newest", "follow", first=True),
            ),
            "What is shown": (
                Key("i", "polls", "what multidrop reads by itself, or not", "its polls"),
                Key("f", "hex", "the form of the bytes: hex and text, or text alone", "form"),
            ),
        },
        ("page",),
    ),
    "start": Sheet(
        "open a connection",
        "Saved connections, what was opened lately, the serial ports, and a demo without hardware. Type to narrow the "
        "list, or type a URL such as /dev/ttyUSB0?baud=19200 or tcp://HOST:503. Enter opens the chosen one. ^F "
        "searches a port for drives whose speed is not known.",
        {
            "Connections": (
                Key("up / down", "step(-1) / step(1)", "the one above, the one below", "choose", first=True),
                Key("enter", "", "open the chosen one, or the URL", "open"),
                Key("tab", "edit", "its URL into the line, to edit it", "edit", first=True),
                Key("ctrl+f", "scan", "find drives on the port, whatever its speed", "find"),
                Key("ctrl+b,insert", "raw", "open it raw: hold every byte back that you do not type", "hold"),
                Key("ctrl+p", "act.palette", "everything by name: type some letters of it", "everything", "palette"),
                Key("f1", "act.help", "help for where you are", "help", "help"),
            ),
        },
        ("box",),
        ("*",),
    ),
    "box": Sheet(
        "boxes",
        "",
        {
            "Boxes": (
                _LEAVE,
                Key("ctrl+q", "app.quit", "quit; asks if something moves", "quit", "quit"),
                Key("ctrl+c", "act.explain", "copy what is selected"),
            )
        },
    ),
    "list": Sheet(
        "a list",
        "Type to narrow it: a row stays if it has what you type. Enter takes the chosen row, and so does a click. "
        "Escape closes the list and takes nothing.",
        {
            "Rows": (
                _STEP,
                _LEAP,
                Key("ctrl+r", "step(1)", "the next row", first=True),
                Key("enter", "", "take the chosen row", "take"),
                Key("f1", "act.help", "help for where you are", "", "help"),
            )
        },
        ("box",),
    ),
    "answers": Sheet(
        "a question with answers",
        "Choose an answer, and take it with Enter. Escape answers nothing.",
        {"Answers": (Key("up / down", " / ", "another answer", "choose"), Key("enter", "", "take it", "take"))},
        ("box",),
    ),
    "question": Sheet(
        "a question before a step",
        "y is yes. Everything else that closes the question is no: n, Escape, a stop.",
        {
            "Answers": (
                Key("y", "answer(True)", "yes, go on", "yes"),
                Key("n", "answer(False)", "no, send nothing", "no"),
                Key("up / down", " / ", "the answer above, below", "choose"),
                Key("pageup / pagedown", "look(-1) / look(1)", "look back, on in the transcript", first=True),
                Key("enter", "", "take the chosen answer", "take"),
            )
        },
        ("box",),
    ),
    "line": Sheet(
        "a line to type",
        "Type it, and take it with Enter. Escape takes nothing.",
        {"The line": (Key("enter", "", "take it", "take"),)},
        ("box",),
    ),
    "form": Sheet(
        "values to fill in",
        "Enter takes a value and goes to the next one, at the last one it takes all. Escape takes none.",
        {
            "Values": (
                Key("down,tab / up,shift+tab", "step(1) / step(-1)", "another value", "value", "", True),
                Key("enter", "", "take the value, at the end all of them", "next"),
            )
        },
        ("box",),
    ),
    "find": Sheet(
        "the search in a transcript",
        "The lines that have what you type are marked. Tab keeps only those.",
        {
            "Lines found": (
                Key("up,enter,ctrl+f / down,shift+enter", "act('older') / act('newer')", "an older, a newer", "step"),
                Key("tab", "act('only')", "show only these", "only these"),
                Key("escape", "act('close')", "close", "close"),
            )
        },
    ),
    "pick": Sheet(
        "lines to copy",
        "The picked lines go to the clipboard of the terminal.",
        {
            "Lines": (
                Key("up / down", "move(-1,False) / move(1,False)", "another line"),
                Key("shift+up / shift+down", "move(-1,True) / move(1,True)", "more lines", "more"),
                Key("space", "act('extend')", "hold this end: the arrows pick more", "hold"),
                Key("enter,c", "act('copy')", "copy them", "copy"),
                Key("escape", "act('close')", "close", "close"),
            )
        },
    ),
}


def bound(name: str) -> list[BindingType]:
    """The bindings of a sheet's own keys. One with a name comes before any widget, as does one with Ctrl.

    So text typed right after a key that opens a dialog is for that dialog.
    """
    made: list[BindingType] = []
    for key in SHEETS[name].keys:
        for keys, action, function in key.single:
            if action and (keys or function):
                first = key.first or bool(function) or keys.startswith("ctrl+")
                spelled = keys or f"{NONE}{function}"
                about = key.about.replace("{}", function.rpartition("-")[2])
                made.append(Binding(spelled, action, about, show=False, priority=first, id=function or None))
    return made


def all_groups(name: str) -> dict[str, list[Key]]:
    """The keys that work with a sheet, in groups: its own, then those of the sheets below it."""
    found: dict[str, list[Key]] = {}
    for sheet in [name, *below(name)]:
        for group, keys in SHEETS[sheet].groups.items():
            taken = {each for keys_ in found.values() for key in keys_ for each in key.keys.split(" / ") if each}
            rest = [key for key in keys if not key.keys or key.keys not in taken]
            found.setdefault(group, []).extend(rest)
    return found


def below(name: str) -> list[str]:
    """The sheets below a sheet, the nearest first."""
    return [each for under in SHEETS[name].below for each in (under, *below(under))]


def footer(name: str) -> list[Key]:
    """The keys in the footer of a sheet, in order."""
    sheet = SHEETS[name]
    own, others = (
        [key for key in sheet.keys if key.word and key.keys],
        sum((SHEETS[each].keys for each in below(name)), []),
    )
    found: list[Key] = []
    for word in sheet.foot:
        found += own if word == "*" else [key for key in others if key.word == word][:1]
    return found


def hint(name: str, **words: str) -> str:
    """The keys of a box in one line; `words` replace those of a key: `enter="open"`."""
    keys = [*SHEETS[name].keys, *(key for each in below(name) for key in SHEETS[each].keys if key == _LEAVE)]
    return "   ".join(f"{key.shown} {words.get(key.keys, key.word)}" for key in keys if key.word)
