//! The page.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::io;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use farfield_core::image::Picture;

use super::equal;
use super::plot::{Point, by_frame, error_against_time};
use super::{Shown, columns, have_lines};
use crate::results::{FrameRow, PipelineSummary, Summary};

const STYLE: &str = "body{font:15px/1.5 system-ui,sans-serif;max-width:1100px;margin:2em auto;padding:0 1em;color:#222}\
table{border-collapse:collapse;margin:1em 0;font-variant-numeric:tabular-nums}td,th{padding:.25em .7em;border-bottom:1px solid #ddd;\
text-align:right}td:first-child,th:first-child,td.t{text-align:left}figure{margin:1em 0}.trio{display:flex;gap:6px}.trio div{flex:1}\
.trio img{width:100%;image-rendering:auto}figcaption,.note{color:#666;font-size:90%}pre{background:#f6f6f6;padding:.8em;overflow:auto}\
.bad{color:#b00;font-weight:600}";

/// A pipeline as a row of [`columns`].
pub(super) fn row(name: &str, p: &PipelineSummary, with_lines: bool) -> Vec<String> {
    let e = p.error.as_ref();
    let or_dash = |v: Option<String>| v.unwrap_or_else(|| "-".into());
    let mut cells = vec![
        name.to_owned(),
        format!("{:.2}", p.frame_ms.mean),
        format!("{:.2}", p.frame_ms.p95),
        if p.floor_ms > 0.0 { format!("{:.2}", p.frame_ms.mean / p.floor_ms) } else { "-".into() },
        format!("{:.0}", p.triangles.total.mean),
        format!("{:.0}", p.triangles.near.mean),
        format!("{:.0}", p.triangles.far.mean),
        format!("{:.0}", p.points.mean),
    ];
    cells.extend(with_lines.then(|| format!("{:.0}", p.lines.mean)));
    cells.extend([
        or_dash(e.map(|e| format!("{:.2}", e.psnr_y_db.mean))),
        or_dash(e.map(|e| format!("{:.2}", e.psnr_y_pooled_db))),
        or_dash(e.map(|e| format!("{:.2}", e.psnr_y_object_db.mean))),
        or_dash(e.and_then(|e| e.ssim).map(|s| format!("{:.4}", s.mean))),
        or_dash(e.and_then(|e| e.flip).map(|f| format!("{:.4}", f.mean))),
        or_dash(e.map(|e| format!("{:.4}", 100.0 * e.hole_fraction.mean))),
        or_dash(e.and_then(|e| e.depth_off_fraction).map(|d| format!("{:.4}", 100.0 * d.mean))),
        or_dash(e.and_then(|e| e.temporal_change_grey_levels).map(|c| format!("{:.3}", c.mean))),
        or_dash(e.and_then(|e| e.temporal_change_at_borders_grey_levels).map(|c| format!("{:.3}", c.mean))),
        format!("{:.1}", p.preprocess.bytes_stored as f64 / 1e6),
    ]);
    cells
}

pub(super) fn run(s: &Summary, frames: &[FrameRow], gallery: &[Shown]) -> io::Result<String> {
    let mut h = page("farfield report");
    let f = &s.scene;
    push(
        &mut h,
        format_args!(
            "<p>{} &mdash; {} triangles, {} objects; {} frames of {} x {} pixels. Machine: {} cores, {}. Pictures are compared with \
         <b>{}</b>, in display space.</p>",
            text(&f.source),
            f.triangles,
            f.objects,
            f.frames,
            f.resolution_px[0],
            f.resolution_px[1],
            s.device.cores,
            text(&s.device.system),
            text(&s.reference),
        ),
    );
    h += "<h2>Error against run time</h2>";
    h += &error_against_time(&points(s, ""))?;
    h += "<p class=note>Up and to the left is better; pipelines whose every frame equals the reference have no point. The floor is the time of one quadrilateral that textures every pixel by \
          projection, on the same device in the same run.</p>";
    pipelines(&mut h, &[(String::new(), s)]);
    push(&mut h, format_args!("<p class=note>Means: {}.</p>", text(&s.equal_frames_note)));
    equal_quality(&mut h, &s.pipelines);
    let times = s.pipelines.iter().filter(|p| p.device.backend == "cpu").map(|p| text(&p.name)).collect::<Vec<_>>();
    if !times.is_empty() {
        push(
            &mut h,
            format_args!(
                "<p class=note>Drawn by the cpu reference, whose time hardly depends on triangles: {}. Lean on the counts there.</p>",
                times.join(", ")
            ),
        );
    }
    details(&mut h, s);
    h += "<h2>Frame by frame</h2>";
    h += &by_frame("PSNR-Y, dB", &series(frames, |r| r.psnr_y_db))?;
    h += &by_frame("change since the frame before, grey levels", &series(frames, |r| r.temporal_change_grey_levels))?;
    h += &by_frame("frame time, ms", &series(frames, |r| Some(r.frame_ms)))?;
    h += &by_frame("triangles", &series(frames, |r| Some((r.near_triangles + r.far_triangles) as f64)))?;
    // Pipelines of triangles alone have nothing to show here.
    if frames.iter().any(|r| r.points > 0) {
        h += &by_frame("points", &series(frames, |r| Some(r.points as f64)))?;
    }
    if frames.iter().any(|r| r.lines > 0) {
        h += &by_frame("lines", &series(frames, |r| Some(r.lines as f64)))?;
    }
    if !gallery.is_empty() {
        h += "<h2>Pictures</h2>";
    }
    for g in gallery {
        push(
            &mut h,
            format_args!(
                "<figure><div class=trio><div>{}</div><div>{}</div><div>{}</div></div><figcaption>{}, frame {}, {}: reference, candidate, \
             luminance difference x 8</figcaption></figure>",
                picture(&g.reference)?,
                picture(&g.candidate)?,
                picture(&difference(&g.reference, &g.candidate))?,
                text(&g.pipeline),
                g.frame,
                text(&g.caption),
            ),
        );
    }
    h += "</body></html>\n";
    Ok(h)
}

pub(super) fn compare(runs: &[(String, Summary)]) -> io::Result<String> {
    let mut h = page("farfield comparison");
    h += "<h2>Error against run time</h2>";
    let all: Vec<Point> = runs.iter().flat_map(|(n, s)| points(s, &format!("{n}: "))).collect();
    h += &error_against_time(&all)?;
    let named: Vec<(String, &Summary)> = runs.iter().map(|(n, s)| (format!("{n}: "), s)).collect();
    pipelines(&mut h, &named);
    for (name, s) in runs {
        push(
            &mut h,
            format_args!(
                "<p class=note>{}: {}, {} triangles, {} x {} pixels, against {}.</p>",
                text(name),
                text(&s.scene.source),
                s.scene.triangles,
                s.scene.resolution_px[0],
                s.scene.resolution_px[1],
                text(&s.reference),
            ),
        );
    }
    h += "</body></html>\n";
    Ok(h)
}

fn page(title: &str) -> String {
    format!(
        "<!doctype html><html lang=en><head><meta charset=utf-8><title>{title}</title><style>{STYLE}</style></head><body><h1>{title}</h1>"
    )
}

fn push(h: &mut String, what: std::fmt::Arguments<'_>) {
    // Writing to a String cannot fail.
    let _ = h.write_fmt(what);
}

fn text(s: &str) -> String {
    s.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn points(s: &Summary, prefix: &str) -> Vec<Point> {
    let of = |p: &PipelineSummary| {
        let e = p.error.as_ref().filter(|e| e.equal_frames < e.frames)?;
        Some(Point { label: format!("{prefix}{}", p.name), frame_ms: p.frame_ms.mean, psnr_y_db: e.psnr_y_db.mean })
    };
    s.pipelines.iter().filter_map(of).collect()
}

fn pipelines(h: &mut String, runs: &[(String, &Summary)]) {
    let with_lines = have_lines(runs.iter().map(|r| r.1));
    *h += "<table><tr>";
    columns(with_lines).iter().for_each(|c| push(h, format_args!("<th>{c}</th>")));
    *h += "</tr>";
    for (prefix, s) in runs {
        for p in &s.pipelines {
            *h += "<tr>";
            let cells = row(&format!("{prefix}{}", p.name), p, with_lines);
            cells.iter().for_each(|c| push(h, format_args!("<td>{}</td>", text(c))));
            *h += "</tr>";
        }
    }
    *h += "</table>";
}

/// What a pipeline costs over each swept one at the same quality.
fn equal_quality(h: &mut String, pipelines: &[PipelineSummary]) {
    let ratios = equal::ratios(pipelines);
    if ratios.is_empty() {
        return;
    }
    *h += "<h2>At equal quality</h2><table><tr><th>pipeline</th><th>over</th><th>at PSNR-Y dB</th>";
    equal::COSTS.iter().for_each(|c| push(h, format_args!("<th>{c}</th>")));
    *h += "</tr>";
    for r in ratios {
        push(
            h,
            format_args!(
                "<tr><td>{}</td><td class=t>{}</td><td>{:.2}</td>",
                text(&r.name),
                text(&r.curve),
                r.psnr_y_db
            ),
        );
        for c in r.cost {
            push(h, format_args!("<td>{}</td>", c.map_or("-".into(), |c| format!("{c:.2}"))));
        }
        *h += "</tr>";
    }
    *h += "</table><p class=note>Costs of the pipeline over those of the swept pipeline, interpolated at the pipeline's own quality; over 1 \
           the pipeline is dearer.</p>";
}

/// How far what is shown lies from the original surface, where that was measured.
fn surface_distances(h: &mut String, pipelines: &[PipelineSummary]) {
    let found = |p: &PipelineSummary| Some((p.name.clone(), p.error.as_ref()?.surface_distance?));
    let rows: Vec<_> = pipelines.iter().filter_map(found).collect();
    if rows.is_empty() {
        return;
    }
    *h += "<h2>Surface distance</h2><table><tr><th>pipeline</th><th>max px</th><th>p99.9 px</th><th>pixels beyond the claim</th>\
           <th>pixels</th></tr>";
    for (name, d) in rows {
        let (bad, name) = (if d.pixels_beyond > 0 { " class=bad" } else { "" }, text(&name));
        push(
            h,
            format_args!(
                "<tr><td>{name}</td><td>{:.3}</td><td>{:.3}</td><td{bad}>{}</td><td>{}</td></tr>",
                d.max_px, d.p999_px, d.pixels_beyond, d.pixels
            ),
        );
    }
    *h += "</table><p class=note>Of every pixel that shows a surface, how far the image of the nearest point of the original lies away; and of \
           every pixel of the reference, that of the nearest point that was drawn. The percentile is the largest of the frames'.</p>";
}

fn details(h: &mut String, s: &Summary) {
    *h += "<h2>Bounds, claimed and measured</h2>";
    if s.pipelines.iter().all(|p| p.bounds.is_empty()) {
        *h += "<p class=note>No pipeline claims a bound, or no audit was asked for.</p>";
    } else {
        *h += "<table><tr><th>pipeline</th><th>claimant</th><th>quantity</th><th>claimed max</th><th>measured max</th><th>p99</th>\
               <th>samples</th><th>violations</th></tr>";
        for (p, b) in s.pipelines.iter().flat_map(|p| p.bounds.iter().map(move |b| (p, b))) {
            push(
                h,
                format_args!(
                    "<tr><td>{}</td><td class=t>{}</td><td class=t>{}</td><td>{:.2}</td><td>{:.2}</td><td>{:.2}</td><td>{}</td><td{}>{}</td></tr>",
                    text(&p.name),
                    text(&b.claimant),
                    b.quantity.name(),
                    b.predicted_max,
                    b.measured_max,
                    b.measured_p99,
                    b.samples,
                    if b.violations > 0 { " class=bad" } else { "" },
                    b.violations,
                ),
            );
        }
        *h += "</table><p class=note>Viewpoints are held out from building. Samples can refute a bound, not prove it.</p>";
    }
    surface_distances(h, &s.pipelines);
    *h += "<h2>Built, and left out</h2><table><tr><th>pipeline</th><th>cells built</th><th>needed</th><th>of</th><th>seconds</th>\
           <th>stored MB</th><th>peak RSS MB</th><th>original : simplified</th></tr>";
    for p in &s.pipelines {
        let b = &p.preprocess;
        push(
            h,
            format_args!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.1}</td><td>{:.1}</td><td>{:.0}</td><td>{}</td></tr>",
                text(&p.name),
                b.cells_built,
                b.cells_needed,
                b.cells_total,
                b.seconds,
                b.bytes_stored as f64 / 1e6,
                b.peak_rss_bytes as f64 / 1e6,
                if p.original_over_simplified > 0.0 {
                    format!("{:.1} : 1", p.original_over_simplified)
                } else {
                    "-".into()
                },
            ),
        );
    }
    *h += "</table><ul>";
    for (p, l) in s.pipelines.iter().flat_map(|p| p.left_out.iter().map(move |l| (p, l))) {
        push(
            h,
            format_args!(
                "<li><b>{}</b>: {} left out: {} (decided: {})</li>",
                text(&p.name),
                text(&l.stage),
                text(&l.reason),
                text(&l.decided)
            ),
        );
    }
    for p in &s.pipelines {
        let m = &p.memory;
        if let Some(limit) = m.limit_bytes {
            push(
                h,
                format_args!(
                    "<li><b>{}</b>: at most {:.1} of {:.1} MB held; {} blocks never fit, {} reads failed, {} blocks given up</li>",
                    text(&p.name),
                    m.peak_bytes as f64 / 1e6,
                    limit as f64 / 1e6,
                    m.blocks_too_large,
                    m.failed_reads,
                    m.blocks_given_up
                ),
            );
        }
        m.troubles.iter().for_each(|t| push(h, format_args!("<li><b>{}</b>: {}</li>", text(&p.name), text(t))));
    }
    *h += "</ul>";
    levels(h, &s.pipelines);
    *h += "<h2>Settings</h2>";
    for p in &s.pipelines {
        let json = serde_json::to_string_pretty(&p.strategies).unwrap_or_default();
        push(
            h,
            format_args!(
                "<details><summary>{} &mdash; {} on {}, time by {}</summary><pre>{}</pre>{}</details>",
                text(&p.name),
                text(&p.device.backend),
                text(&p.device.device),
                text(&p.frame_ms_source),
                text(&json),
                p.device.degraded.iter().map(|d| format!("<p class=note>{}</p>", text(d))).collect::<String>(),
            ),
        );
    }
}

/// The census of hierarchies: nodes, triangles and points a level.
fn levels(h: &mut String, pipelines: &[PipelineSummary]) {
    if pipelines.iter().all(|p| p.levels.is_empty()) {
        return;
    }
    *h += "<h2>Levels of detail</h2><table><tr><th>pipeline</th><th>level, coarsest first</th><th>nodes</th><th>triangles</th><th>a node</th><th>points</th><th>a node</th></tr>";
    for (p, l) in pipelines.iter().flat_map(|p| p.levels.iter().map(move |l| (p, l))) {
        let all = |n: Option<u64>| n.map_or("-".into(), |n| n.to_string());
        let mean = |n: Option<u64>| n.map_or("-".into(), |n| format!("{:.0}", n as f64 / l.nodes.max(1) as f64));
        push(
            h,
            format_args!(
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
                text(&p.name),
                l.level,
                l.nodes,
                all(l.triangles),
                mean(l.triangles),
                all(l.points),
                mean(l.points)
            ),
        );
    }
    *h += "</table>";
}

fn series(frames: &[FrameRow], value: impl Fn(&FrameRow) -> Option<f64>) -> Vec<(String, Vec<(f64, f64)>)> {
    let mut by: BTreeMap<usize, (String, Vec<(f64, f64)>)> = BTreeMap::new();
    let mut order: Vec<&str> = vec![];
    for r in frames {
        let at = order.iter().position(|n| *n == r.pipeline).unwrap_or_else(|| {
            order.push(&r.pipeline);
            order.len() - 1
        });
        let entry = by.entry(at).or_insert_with(|| (r.pipeline.clone(), vec![]));
        entry.1.extend(value(r).map(|v| (r.frame as f64, v)));
    }
    by.into_values().filter(|s| !s.1.is_empty()).collect()
}

fn picture(p: &Picture) -> io::Result<String> {
    let bytes: Vec<u8> = p.rgba.iter().flatten().copied().collect();
    let mut png = io::Cursor::new(vec![]);
    image::write_buffer_with_format(
        &mut png,
        &bytes,
        p.size[0],
        p.size[1],
        image::ExtendedColorType::Rgba8,
        image::ImageFormat::Png,
    )
    .map_err(io::Error::other)?;
    Ok(format!("<img alt=\"\" src=\"data:image/png;base64,{}\">", STANDARD.encode(png.into_inner())))
}

/// Luminance differences, eight times enlarged: red where the candidate is brighter, blue where it is darker.
fn difference(reference: &Picture, candidate: &Picture) -> Picture {
    let pixel = |(&a, &b): (&[u8; 4], &[u8; 4])| {
        let d = 8.0 * (farfield_core::color::luma(b) - farfield_core::color::luma(a));
        let fade = (255.0 - d.abs()).clamp(0.0, 255.0) as u8;
        if d >= 0.0 { [255, fade, fade, 255] } else { [fade, fade, 255, 255] }
    };
    Picture { size: reference.size, rgba: reference.rgba.iter().zip(&candidate.rgba).map(pixel).collect() }
}
