"""Everything between the terminal and the app: bytes to keys, keys in order, frames at the terminal's pace.

The debt: what is used here of Textual 8 that is private to it, why, and the upstream change that would end each.

- `driver.Terminal` extends `LinuxDriver` (`_enable_*`, `_patch_*`, `_must_signal_resume`): the stop
  is found in the bytes before any parser, and a write never waits. Ends with a driver whose input and output are given.
- `keystream` feeds `_xterm_parser.XTermParser` and knows `_ansi_sequences`: the parser takes a stream whole; its rest
  cannot be dropped at a stop. Ends with a public parser that is fed in pieces and reset.
- `keyboard` asks `_modal_binding_chain` and `_check_action_state` for one key: a key is complete before the next one
  counts, and `active_bindings` asks for every key. Ends with queues of keys that keep their order.
- `canvas.FrontCompositor` overrides `Compositor._render_chops`: covered widgets are not rendered. Ends once Textual
  cuts only what is seen.
- `canvas.Canvas` takes `ChopsUpdate` and `LayoutUpdate`, which `app.MultidropApp._display` intercepts: only cells that
  differ are written, and rows that move up are scrolled. Ends with a driver that is given strips instead of text.
- `app` adds to `_action_targets`: actions are parts of the app and no methods of it. Ends with public targets.
- `tui.editor` uses `TextArea._find_columns_to_next_tab_stop` and `_on_paste`. Ends with public names.

A release of Textual is tried with tests/tui; `pyproject.toml` bounds it below 9.
"""
