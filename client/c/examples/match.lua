-- Matches two mesh files in this process: luajit match.lua X Y, and prints for each
-- vertex of X its vertex of Y. The header is read as it is, so nothing has to be
-- declared again; ISOMATCH_HEADER names it where it is not in /usr/include.
local ffi = require("ffi")

local function declare(path)
  local file = assert(io.open(path), path .. ": no such header")
  local text = "\n" .. file:read("*a")
  file:close()
  text = text:gsub("\n#[^\n]*", ""):gsub('extern "C" {', ""):gsub("\n}%s*/%* extern.-%*/", "")
  ffi.cdef((text:gsub("ISOMATCH_API", "")))
end

declare(os.getenv("ISOMATCH_HEADER") or "/usr/include/isomatch.h")
local isomatch = ffi.load("isomatch.so.0")

-- Calls a function whose last argument is an error; stops with what that says.
local function call(name, ...)
  local arguments, count = { ... }, select("#", ...)
  local failed = ffi.new("isomatch_error*[1]")
  arguments[count + 1] = failed
  if isomatch[name](unpack(arguments, 1, count + 1)) ~= isomatch.ISOMATCH_OK then
    local message = ffi.string(isomatch.isomatch_error_message(failed[0]))
    isomatch.isomatch_error_free(failed[0])
    io.stderr:write(message, "\n")
    os.exit(1)
  end
end

-- Read, and given back when it is no longer used.
local function read(path)
  local file = ffi.new("isomatch_mesh_file*[1]")
  call("isomatch_mesh_file_read", path, file)
  return ffi.gc(file[0], isomatch.isomatch_mesh_file_free)
end

if #arg ~= 2 then
  io.stderr:write("usage: luajit match.lua X Y\n")
  os.exit(2)
end
local x, y = read(arg[1]), read(arg[2])
local pair = ffi.new("isomatch_pair")
pair.mesh_x, pair.mesh_y = isomatch.isomatch_mesh_file_mesh(x), isomatch.isomatch_mesh_file_mesh(y)
local found = ffi.new("isomatch_result*[1]")
call("isomatch_match", pair, nil, nil, found)
local result = ffi.gc(found[0], isomatch.isomatch_result_free)
local map = isomatch.isomatch_result_map(result)
for vertex = 0, tonumber(isomatch.isomatch_result_num_vertices(result)) - 1 do
  print(map[vertex])
end
io.stderr:write(ffi.string(isomatch.isomatch_result_verdict(result)), "\n")
