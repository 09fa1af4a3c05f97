#!/bin/bash
# The whole suite from nothing: installs what is missing, builds, runs every test program within a budget of minutes,
# then the suite once more under the address and undefined-behaviour sanitizers.
# Exit code 0 when everything passed. The last line is "N passed, N failed, N skipped": published scenes that are not beside
# the repository are skipped.
set -u
cd "$(dirname "$0")/.."

passed=0 failed=0 skipped=0
begin=$SECONDS
clock() { printf '%d:%02d' $(((SECONDS - begin) / 60)) $(((SECONDS - begin) % 60)); }

# run BUILD_DIRECTORY NAME MINUTES
# In two halves at once: many tests leave a processor idle.
run() {
  local program="$1/$2_tests" name="$1/$2" minutes="$3" reports half halves=()
  reports=$(mktemp -d)
  echo "== $name: at most $minutes minutes, begins at $(clock)"
  for half in 0 1; do
    GTEST_TOTAL_SHARDS=2 GTEST_SHARD_INDEX=$half timeout --kill-after=10 $((60 * minutes)) \
      "$program" --gtest_brief=1 --gtest_output=json:"$reports/$half" >"$reports/$half.log" 2>&1 &
    halves+=($!)
  done
  for half in 0 1; do
    wait "${halves[$half]}"
    judge "$name" "$minutes" $? "$reports/$half"
  done
  rm -rf "$reports"
}

# judge NAME MINUTES CODE REPORT: counts what one half says.
judge() {
  local name="$1" minutes="$2" code="$3" all bad left
  cat "$4.log"
  if [ -s "$4" ]; then
    read -r all bad left < <(python3 -c 'import json, sys
r = json.load(open(sys.argv[1]))
skipped = sum(t.get("result") == "SKIPPED" for s in r["testsuites"] for t in s["testsuite"])
print(r["tests"], r["failures"] + r["errors"], skipped)' "$4")
    passed=$((passed + all - bad - left)) failed=$((failed + bad)) skipped=$((skipped + left))
    [ "$bad" -eq 0 ] && [ "$code" -ne 0 ] && failed=$((failed + 1))
  else
    failed=$((failed + 1))
  fi
  [ "$code" -eq 124 ] && echo "$name: over its budget of $minutes minutes"
  [ "$code" -ne 0 ] && [ "$code" -ne 1 ] && [ "$code" -ne 124 ] && echo "$name: ended with code $code"
}

# Would the suite notice? A few of tests/mutants, others with each commit; one that survives is a failure.
sample_mutants() {
  local minutes="$1" said
  commit=$(git rev-parse HEAD 2>/dev/null) || { echo "== mutants: none without a git repository"; return; }
  echo "== mutants: at most $minutes minutes, begins at $(clock)"
  said=$(tests/mutants/run.py --sample 2 --seed "$commit" --jobs 2 --minutes "$minutes" 2>&1) || failed=$((failed + 1))
  echo "$said"
  passed=$((passed + $(grep -c '^| [a-z0-9_]* *| killed' <<<"$said")))
}

build() {
  echo "== build $1: begins at $(clock)"
  cmake --preset "$1" >/dev/null && cmake --build --preset "$1" -- --quiet
}

# Mutants are compiled in a copy, which finds here what they do not change.
export CCACHE_BASEDIR="$PWD" CCACHE_NOHASHDIR=1
tools/setup.sh chromium || exit 1  # looks at the laboratory's page
build release || { echo "0 passed, 1 failed, 0 skipped"; exit 1; }
run build cache 3
run build shading 3
run build pipeline 5
run build failures 4
run build tools 6
sample_mutants 4

# Leaks are looked for in our own allocations; the libraries keep global tables for the life of the process.
export ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=print_stacktrace=1
build asan || { echo "$passed passed, $((failed + 1)) failed, $skipped skipped"; exit 1; }
run build/asan cache 4
run build/asan shading 4
run build/asan pipeline 10
run build/asan failures 8
run build/asan tools 10

echo "took $(clock)"
echo "$passed passed, $failed failed, $skipped skipped"
[ "$failed" -eq 0 ]
