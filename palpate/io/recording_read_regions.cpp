// SPDX-License-Identifier: Apache-2.0
// Parts of the object with a stiffness of their own.
#include <algorithm>
#include <limits>
#include <set>

#include "palpate/io/recording_names.hpp"
#include "palpate/io/recording_reader.hpp"

namespace palpate::io {
namespace {

// Sites: given in place, or as vertices of the rest mesh.
Points read_points(YamlKeys& keys, RecordingContext& context) {
  const auto given = keys.optional("points_m");
  if (!given) {
    if (!keys.has("file") && !keys.has("vertices")) keys.map().fail("needs its points: 'points_m', or 'file' or 'vertices'");
    const std::vector<Index> vertices = read_index_list(keys, context);
    const Points& nodes =
        context.recording.rest.volume ? context.recording.rest.volume->nodes_m : context.recording.rest.surface->vertices_m;
    Points points(static_cast<Index>(vertices.size()), 3);
    for (std::size_t i = 0; i < vertices.size(); ++i) points.row(static_cast<Index>(i)) = nodes.row(vertices[i]);
    return points;
  }
  const auto items = given->items();
  if (items.empty()) given->fail("holds no point");
  Points points(static_cast<Index>(items.size()), 3);
  for (std::size_t i = 0; i < items.size(); ++i) points.row(static_cast<Index>(i)) = items[i].vector3();
  return points;
}

std::vector<Index> read_elements(YamlKeys& keys, RecordingContext& context) {
  const auto file = keys.optional("file"), list = keys.optional("elements");
  if (file.has_value() == list.has_value()) keys.map().fail("give either 'file' or 'elements'");
  const std::string where = file ? context.folder.path_of(file->text()) : list->where();
  std::vector<Index> elements;
  if (file) {
    elements = parse_named(file->where(), [&] { return parse_indices(context.folder.read(file->text(), file->where()), where); });
  } else {
    for (const YamlField& item : list->items()) elements.push_back(item.whole(0, std::numeric_limits<Index>::max()));
    if (elements.empty()) list->fail("holds no index");
  }
  if (!context.recording.rest.volume) throw Error("elements need a 'volume_mesh' at rest; choose the region by a box or by points", where);
  const Eigen::Index count = context.recording.rest.volume->tetrahedra.rows();
  for (const Index e : elements) {
    if (e < 0 || e >= count)
      throw Error("element " + std::to_string(e) + " is not in the volume mesh, which has " + std::to_string(count) +
                      " (indices are 0-based)",
                  where);
  }
  return elements;
}

}  // namespace

void read_regions(const YamlField& field, RecordingContext& context) {
  std::vector<Region>& regions = context.recording.regions;
  std::set<Index> taken;
  for (const YamlField& item : field.items()) {
    YamlKeys keys(item);
    Region region;
    region.source = item.where();
    const YamlField name = keys.required("name", "results name the region by it");
    region.name = name.text();
    if (region.name.empty()) name.fail("must not be empty");
    for (const Region& other : regions)
      if (other.name == region.name) name.fail("there is a region '" + region.name + "' already");
    const YamlField kind = keys.required("kind", "choose box, points, elements or rest");
    region.select = kind.choice<RegionSelection>(region_names);
    switch (region.select) {
      case RegionSelection::box: {
        region.box_min_m = keys.required("min_m").vector3();
        const YamlField max = keys.required("max_m");
        region.box_max_m = max.vector3();
        if ((region.box_max_m - region.box_min_m).minCoeff() <= 0) max.fail("must be larger than min_m in every axis");
        break;
      }
      case RegionSelection::points: region.points_m = read_points(keys, context); break;
      case RegionSelection::elements:
        region.elements = read_elements(keys, context);
        for (const Index e : region.elements)
          if (!taken.insert(e).second) item.fail("element " + std::to_string(e) + " is named twice");
        break;
      case RegionSelection::rest:
        if (std::any_of(regions.begin(), regions.end(), [](const Region& other) { return other.select == RegionSelection::rest; }))
          kind.fail("another region takes the rest already");
        break;
    }
    keys.finish();
    regions.push_back(std::move(region));
  }
  if (regions.size() < 2) field.fail("needs two regions or more; without regions the object has one stiffness everywhere");
  const auto has = [&](RegionSelection select) {
    return std::any_of(regions.begin(), regions.end(), [&](const Region& region) { return region.select == select; });
  };
  if (has(RegionSelection::points) && has(RegionSelection::rest))
    field.fail("regions around points leave no rest: every element lies nearest to one of the points");
}

}  // namespace palpate::io
