// A planned job as a Nextflow process:
//   scanshade plan DATASET -o JOB --method surfel
//   nextflow run apps/jobs/workflows/scanshade.nf --job /absolute/JOB --shards 16
nextflow.enable.dsl = 2

params.job = null // absolute: every node sees it
params.shards = 1
params.program = 'scanshade'

process shard {
    tag "${index}/${params.shards}"
    // 4: interrupted, device lost, disk full: another try continues. All else is no better the next time.
    errorStrategy { task.exitStatus == 4 && task.attempt <= 5 ? 'retry' : 'finish' }
    maxRetries 5

    input:
    val index

    output:
    val index

    // 2 (some frames' input is bad) and 3 (nothing could be done) are answers: the job's report names them.
    shell:
    '''
    code=0
    "!{params.program}" run "!{params.job}" --shard !{index}/!{params.shards} || code=$?
    case $code in 0|2|3) ;; *) exit $code ;; esac
    '''
}

process merge {
    input:
    val shards

    shell:
    '''
    code=0
    "!{params.program}" merge "!{params.job}" || code=$?
    case $code in 0|2|3) ;; *) exit $code ;; esac
    '''
}

workflow {
    if (!params.job)
        error 'give --job /absolute/JOB, the folder that `scanshade plan` wrote'
    merge(shard(Channel.of(1..params.shards)).collect())
}
