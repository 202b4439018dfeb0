mod common;
use common::*;
use farfield_core::image::SurfaceImage;
use farfield_cpu::SplatOrder;

fn png(name: &str, i: &SurfaceImage, mark: Option<&SurfaceImage>) {
    let mut out = image::RgbImage::new(i.size[0], i.size[1]);
    for (k, p) in out.pixels_mut().enumerate() {
        let n = farfield_core::image::from_octahedral(i.normal[k]);
        let l = 0.4 + 0.6 * n.dot(glam::Vec3::new(0.4, 0.7, 0.6).normalize()).max(0.0);
        *p = if i.hit(k) {
            image::Rgb([0, 1, 2].map(|c| (f32::from(i.albedo[k][c]) * l) as u8))
        } else {
            image::Rgb([20, 30, 60])
        };
        if mark.is_some_and(|m| m.hit(k) && !i.hit(k)) {
            *p = image::Rgb([255, 0, 255]);
        }
    }
    out.save(format!("/tmp/ldi-{name}.png")).unwrap();
}

#[test]
fn look() {
    let scene = pipes(2500, 7);
    let v = views([512, 512]);
    let cell = ball(&scene, 6.0, 8.0, v.px_per_tan());
    println!("far {} of {}", cell.splits[0].far.len(), scene.chunks.len());
    let cams = tour(&cell, &v, 12, 3);
    let refs = direct(&scene, &cell.splits[0].far, &cams);
    for set in ["construction_images = 1",  "", "density = 2.0"] {
        let t = std::time::Instant::now();
        let kept = bake(&scene, &v, &cell, set, 2);
        let took = t.elapsed();
        let p = &kept.index().pictures[0];
        println!(
            "{set}: {took:?} {:?} samples {} covered {} deepest {} round {}",
            p.size, p.samples, p.covered, p.deepest, p.rounding_px
        );
        for order in [SplatOrder::OcclusionCompatible, SplatOrder::Nearest] {
            let mut b = loaded(&scene, &kept, order);
            let mut a = Apart::default();
            let mut worst = (0, 0);
            for (k, (c, r)) in cams.iter().zip(&refs).enumerate() {
                let w = warped(&mut b, &scene, &kept, 0, c);
                let before = a.holes;
                a.add(r, &w);
                if a.holes - before > worst.0 {
                    worst = (a.holes - before, k);
                }
            }
            let both = a.pixels;
            println!(
                "  {order:?} holes {:.4}% inner {:.4}% extra {:.4}% other {:.3}% albedo {:.3} worst {worst:?}",
                100.0 * a.share(a.holes), 100.0 * a.share(a.inner),
                100.0 * a.share(a.extra),
                100.0 * a.share(a.other),
                a.albedo / both as f64
            );
            let k = worst.1;
            let w = warped(&mut b, &scene, &kept, 0, &cams[k]);
            let name = set.replace([' ', '=', '.'], "");
            png(&format!("{name}-{order:?}"), &w, Some(&refs[k]));
            png(&format!("{name}-ref"), &refs[k], None);
        }
        let centre = v.camera(cell.outline.centre.as_dvec3(), 0.0, 0.0);
        let mut b = loaded(&scene, &kept, SplatOrder::Nearest);
        let mut a = Apart::default();
        a.add(&direct(&scene, &cell.splits[0].far, &[centre])[0], &warped(&mut b, &scene, &kept, 0, &centre));
        println!("  centre {a:?}");
        let Some(farfield_core::payload::Part::Layered(l)) = kept.payloads.values().next().map(|p| p.parts[0].clone())
        else {
            panic!()
        };
        let raw = postcard::to_allocvec(&l).unwrap();
        let z = zstd::bulk::compress(&raw, 3).unwrap();
        println!(
            "  bytes/sample raw {:.3} zstd {:.3}",
            raw.len() as f64 / l.samples() as f64,
            z.len() as f64 / l.samples() as f64
        );
    }
}
