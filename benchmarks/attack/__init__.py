"""The attack: everything that this tool takes in or writes, hit on purpose, by one command with counts and seeds.

    python benchmarks/attack                         every attack, short: about a minute
    python benchmarks/attack --long                  ten million inputs, a hundred kills, ...: hours
    python benchmarks/attack fuzz kills --times 10   some attacks, so many times their short count
    python benchmarks/attack fuzz --only filters --seed 7 --first 1234 --inputs 1    one input again
    python benchmarks/attack fuzz --account campaign.jsonl --inputs 10000000    goes on where the account ends

Each attack is a file: `fuzz` (readers, pasted text and log lines, filters and rules, spoilt and derived from their own
grammars, settings and files beside a capture, flags and prompts, maps, manifests of lakes, lists of rings, the
analysis, exporters),
`kills` (kill -9 while recording), `damage` (cuts at every byte, bad sectors, flipped bits), `storms` (a recorder under
full and failing disks, files taken away, clocks that are set, restarts), `lines` (gateways that restart, adapters
that are unplugged), `taps` (a tap that is hostile, viewers that are). Prints a line for each with its figures, and what
did not hold with what brings it back.
Exit status 1 where something did not hold. Needs Linux, macOS or the like.
"""
