-- Neovim 0.7 to 0.10: put this into ~/.config/nvim/plugin/multidrop.lua.
vim.api.nvim_create_autocmd({ "BufRead", "BufNewFile" }, {
  pattern = { "*.mxt", "*.prg", "*.asc" },
  callback = function(args)
    vim.bo[args.buf].filetype = args.file:lower():match("%.mxt$") and "mcode" or "ascript"
  end,
})
vim.api.nvim_create_autocmd("FileType", {
  pattern = { "mcode", "ascript" },
  callback = function(args)
    vim.bo[args.buf].commentstring = vim.bo[args.buf].filetype == "mcode" and "' %s" or "; %s"
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
