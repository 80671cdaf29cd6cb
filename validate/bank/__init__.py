"""A bank of views: hundreds of configurations drawn from few renders, all metrics and noise models judged on them."""
