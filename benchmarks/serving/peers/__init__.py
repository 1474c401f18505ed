"""One server a file, each as its own documentation recommends; `benchmarks.serving.servers` starts them."""
