// The functions of stones_rich.wgsl for adapters that draw on the CPU: the ground as it is from afar.
fn broken(m: Material, s: Site, amount: f32) -> Material { return m; }

fn heaped(m: Material, s: Site, amount: f32) -> Material { return m; }

fn tufted(m: Material, s: Site, dry: f32) -> Material { return m; }

fn crowned(m: Material, s: Site) -> Material { return m; }
