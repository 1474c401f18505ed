"""The data path, one line a stage. (Being built: the contract below is what the rest may rely on.)

    pipeline = Pipeline(load_bundle(path))
    recognition = pipeline.run(contact, Options())           # in process
    work = pipeline.begin(contact, Options())                # or step by step, as the executor does:
    for stage in pipeline.stages: stage.run(work)            # each stage has .name and .run(work) -> None
    recognition = pipeline.finish(work, stage_ms)            # stage_ms: {stage name: milliseconds}
"""
