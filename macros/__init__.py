"""Macros: record, store and play lines of text. The room knows times, files and a `run(line)` that it is given."""

from multidrop.macros.model import FIRST_PAGE as FIRST_PAGE
from multidrop.macros.model import KEYS as KEYS
from multidrop.macros.model import Macro as Macro
from multidrop.macros.model import MacroParameter as MacroParameter
from multidrop.macros.model import MacroStep as MacroStep
from multidrop.macros.model import check as check
from multidrop.macros.model import check_name as check_name
from multidrop.macros.model import checked_values as checked_values
from multidrop.macros.model import escape as escape
from multidrop.macros.model import fill as fill
from multidrop.macros.model import filled as filled
from multidrop.macros.model import is_role as is_role
from multidrop.macros.model import missing as missing
from multidrop.macros.model import page_order as page_order
from multidrop.macros.model import value_names as value_names
from multidrop.macros.recorder import Recorder as Recorder
from multidrop.macros.store import MacroStore as MacroStore
from multidrop.macros.toml_format import format_macro as format_macro
from multidrop.macros.toml_format import parse_macro as parse_macro
