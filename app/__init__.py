"""What a person sees: Qt windows, workflows, command line. The only place that imports Qt."""
