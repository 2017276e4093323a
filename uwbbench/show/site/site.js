base.root.dataset.ready = "yes";
