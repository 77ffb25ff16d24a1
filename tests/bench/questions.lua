-- Asks for the paths in the file PATHS, one after the other, and prints what came of it as one line of JSON.
local paths = {}
for line in io.lines(os.getenv("PATHS")) do
  paths[#paths + 1] = line
end
local at = 0

function request()
  at = at % #paths + 1
  return wrk.format("GET", paths[at])
end

function done(summary, latency, requests)
  local errors = summary.errors
  local bad = errors.connect + errors.read + errors.write + errors.status + errors.timeout
  io.write(string.format(
    '{"answers": %d, "bad": %d, "per_second": %.3f, "p50_ms": %.3f, "p95_ms": %.3f}\n',
    summary.requests, bad, summary.requests / summary.duration * 1e6,
    latency:percentile(50) / 1000, latency:percentile(95) / 1000))
end
