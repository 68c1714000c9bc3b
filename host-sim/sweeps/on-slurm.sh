#!/usr/bin/env bash
# Spreads a sweep over the nodes of a Slurm cluster: an array job of parts, then one that puts them together.
#
#     host-sim/sweeps/on-slurm.sh SWEEP.toml OUT.parquet SHARDS [OPTIONS OF SBATCH...]
#
# host-sim must be in the PATH of the nodes; sweep file and output on a file system that all of them see. Part 3 that
# was killed goes on where it was with `scontrol requeue JOB_3`, or by itself with --requeue.
set -euo pipefail
if [ $# -lt 3 ]; then
    sed -n '2,7s/^# \{0,1\}//p' "$0" >&2
    exit 2
fi
sweep=$(realpath "$1")
out=$(realpath -m "$2")
shards=$3
shift 3
parts=$out.shards
mkdir -p "$parts"
name=$(basename "$sweep" .toml)

# One core for each part.
array=$(sbatch --parsable --job-name="$name" --array="1-$shards" --cpus-per-task=1 \
    --output="$parts/%a.log" "$@" <<END
#!/usr/bin/env bash
RAYON_NUM_THREADS=1 exec host-sim sweep --quiet '$sweep' --out '$parts'/\$SLURM_ARRAY_TASK_ID.parquet \
    --shard \$SLURM_ARRAY_TASK_ID/$shards
END
)
sbatch --parsable --job-name="$name-merge" --dependency="afterok:${array%%;*}" \
    --output="$parts/merge.log" "$@" <<END
#!/usr/bin/env bash
exec host-sim sweep merge --quiet '$out' '$parts'/{1..$shards}.parquet
END
