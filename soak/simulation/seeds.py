"""Seeds that every run lives: those that broke a rule once, each with what it found. A seed joins with the mend."""

from __future__ import annotations

FIXED = {
    3: "error 20 of a half-sent line, which the drive reported for the next move",
    9: "the error of a line that a stop cut off, which the next line was blamed for",
    137: "the same, where the stop came before the outcome was read",
    472: "a value that a drive does not print, which ended the prompt at /status",
    882: "the same, which a wait took for rest",
    2027: "a stop through a shared port, dropped by the purge before it in the same read",
    2177: "the conditions of a drive that nobody wanted any more, which were read as that was said",
    373: "a view of a relay's bytes, held by the error of a failed send (of the simulation itself)",
    797: "the error of a refused Modbus write, whose flag was read too late, which the next line was blamed for",
    15: "a terminal that hung up after the end of the story (of the simulation itself)",
    116: "the error of a Modbus write that was refused after its time-out, which the next line was blamed for",
    3025: "a script's line that a macro recorded, and played (of the simulation itself)",
    4478: "a line that waited for the end of a download, taken for one of program mode (of the simulation itself)",
    10177: "a value of a drive that was without power, set while the question ran (of the simulation itself)",
    14645666: "a backup in a state folder whose own name was not synced, lost in a power cut",
    13622070: "a folder that a power cut took away, with the echo mode that was owed to a drive",
    87: "a print without an end, kept while the rest of a reply that a stop had cut off was awaited",
    282: "an earlier stop, confirmed as another one came, which `log judge` took for one after too few replies",
    101: "a value that noise changed in the moment in which it was shown (of the simulation itself)",
    191: "lines of program mode while a stop was being confirmed (of the simulation itself)",
    268: "a command beside a running program, without a sign that it was executed (of the simulation itself)",
    299: "a value with the reply to a stop behind it, whose CR noise had taken (of the simulation itself)",
    380: "the rest of a stop that left later than the next two stops (of the simulation itself)",
    479: "a stop behind the drop of the stop before, whose bytes had not left (of the simulation itself)",
    622: "a stop whose thread came to a lost line only as it was back (of the simulation itself)",
    691: "a stop whose rest the next stop dropped (of the simulation itself)",
    1155: "a stop that the port refused first (of the simulation itself)",
    1315: "the rest of a message to a relay, of which the judge asked the other end (of the simulation itself)",
    12175655: "the K of another client's OK, which was shown as a value",
    1164: "an earlier stop, confirmed as another one came by what was read before that",
    1406: "a stop behind 28 others that the far end of a relay had not taken (of the simulation itself)",
    1499: "what noise left of two OKs, which was shown as a value",
    2381549: "a state folder that the log had made and not synced, lost in a power cut with the echo mode owed",
    1502: "a stored line that was typed before a stop, too (of the simulation itself)",
    20156: "a stop behind a drop that left in two pieces (of the simulation itself)",
}
DERIVED = 12
"""The number of seeds that follow from the commit."""
