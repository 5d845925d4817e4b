"""The language server of `multidrop lsp`: program files in editors that speak the Language Server Protocol."""
