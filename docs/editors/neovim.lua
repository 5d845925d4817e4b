-- Neovim 0.7 to 0.10: put this into ~/.config/nvim/plugin/multidrop.lua.
vim.api.nvim_create_autocmd({ "BufRead", "BufNewFile" }, {
  pattern = { "*.mxt", "*.prg", "*.asc", "*.tmc", "*.tmcl" },
  callback = function(args)
    local types = { mxt = "mcode", tmc = "tmcl", tmcl = "tmcl" }
    vim.bo[args.buf].filetype = types[args.file:lower():match("%.(%w+)$")] or "ascript"
  end,
})
vim.api.nvim_create_autocmd("FileType", {
  pattern = { "mcode", "ascript", "tmcl" },
  callback = function(args)
    local remarks = { mcode = "' %s", tmcl = "// %s" }
    vim.bo[args.buf].commentstring = remarks[vim.bo[args.buf].filetype] or "; %s"
    vim.bo[args.buf].omnifunc = "v:lua.vim.lsp.omnifunc"
    local config = { name = "multidrop", cmd = { "multidrop", "lsp" }, root_dir = vim.fn.getcwd() }
    if vim.lsp.start then
      vim.lsp.start(config)
    else
      vim.g.multidrop_client = vim.g.multidrop_client or vim.lsp.start_client(config)
      vim.lsp.buf_attach_client(args.buf, vim.g.multidrop_client)
    end
  end,
})
