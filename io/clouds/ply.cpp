// PLY 1.0 (Turk 1994): header checked line by line, the vertices walked, everything else kept as the file's own bytes.
#include "io/clouds/cloud_records.h"

#include "io/clouds/cloud_edit.h"
#include "io/clouds/mesh_textures.h"
#include "io/clouds/packed_splats.h"
#include "io/clouds/splats.h"
#include "io/file_bytes.h"
#include "io/text.h"
#include "projection/base/error.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>
#include <limits>
#include <map>

namespace scanshade {

namespace fs = std::filesystem;

namespace {

using Encoding = CloudRecords::Encoding;

constexpr std::size_t longest_ply_header = 1 << 20;
constexpr std::uint64_t most_records = 0x7fffffff;

struct Element {
    std::string name;
    std::uint64_t count = 0;
    int line = 0;
    std::vector<CloudField> properties;
    std::size_t properties_end = 0; ///< offset in the header behind the last property's line

    [[nodiscard]] bool lists() const {
        return std::any_of(properties.begin(), properties.end(),
                           [](const CloudField& p) { return p.list_length.has_value(); });
    }
    /// Bytes of a record whose lists are empty.
    [[nodiscard]] std::size_t least_bytes() const {
        std::size_t sum = 0;
        for (const CloudField& p : properties)
            sum += p.list_length ? size_of(*p.list_length) : p.bytes();
        return sum;
    }
};

struct PlyHeader {
    Encoding encoding = Encoding::ascii;
    std::vector<Element> elements;
    std::size_t length = 0;
    int next_line = 0;
    std::optional<std::uint64_t> columns, rows; ///< obj_info num_cols and num_rows: an organised cloud
};

// --- header ---

Scalar scalar_named(std::string_view name, const fs::path& file, int line) {
    struct Row {
        std::string_view name, sized;
        Scalar type;
    };
    static constexpr std::array rows{
        Row{"char", "int8", Scalar::int8},        Row{"uchar", "uint8", Scalar::uint8},
        Row{"short", "int16", Scalar::int16},     Row{"ushort", "uint16", Scalar::uint16},
        Row{"int", "int32", Scalar::int32},       Row{"uint", "uint32", Scalar::uint32},
        Row{"float", "float32", Scalar::float32}, Row{"double", "float64", Scalar::float64}};
    for (const Row& row : rows)
        if (name == row.name || name == row.sized)
            return row.type;
    throw Error(fmt::format("{}: property type {}, expected char, uchar, short, ushort, int, uint, float or double",
                            at_line(file, line), in_quotes(name)));
}

Encoding encoding_named(const std::vector<std::string_view>& line, const fs::path& file, int number) {
    if (line.size() != 3 || line[2] != "1.0")
        throw Error(fmt::format("{}: expected \"format <encoding> 1.0\"", at_line(file, number)));
    if (line[1] == "ascii")
        return Encoding::ascii;
    if (line[1] == "binary_little_endian")
        return Encoding::binary;
    if (line[1] == "binary_big_endian")
        return Encoding::big_endian;
    throw Error(fmt::format("{}: format {}, expected ascii, binary_little_endian or binary_big_endian",
                            at_line(file, number), in_quotes(line[1])));
}

Element element_of(const std::vector<std::string_view>& line, const fs::path& file, int number,
                   std::size_t header_end) {
    if (line.size() != 3)
        throw Error(fmt::format("{}: expected \"element <name> <count>\"", at_line(file, number)));
    const auto count = whole_number(line[2]);
    if (!count || *count > most_records)
        throw Error(fmt::format("{}: element {} has count {}, expected 0 .. {}", at_line(file, number),
                                in_quotes(line[1]), in_quotes(line[2]), most_records));
    return {std::string(line[1]), *count, number, {}, header_end};
}

CloudField property_of(const std::vector<std::string_view>& line, const fs::path& file, int number) {
    CloudField property;
    const bool list = line.size() == 5 && line[1] == "list";
    if (!list && line.size() != 3)
        throw Error(fmt::format("{}: expected \"property <type> <name>\" or \"property list <type> <type> <name>\"",
                                at_line(file, number)));
    property.name = line.back();
    property.type = scalar_named(line[line.size() - 2], file, number);
    if (list)
        property.list_length = scalar_named(line[2], file, number);
    if (list && (*property.list_length == Scalar::float32 || *property.list_length == Scalar::float64))
        throw Error(fmt::format("{}: a list's length cannot be a float", at_line(file, number)));
    return property;
}

/// How the header's lines end, as its first one tells: LF, also behind CR; CR alone; LF CR.
std::string_view line_end_of(std::string_view bytes) {
    const std::size_t at = bytes.find_first_of("\r\n");
    const std::string_view rest = at == std::string_view::npos ? std::string_view() : bytes.substr(at);
    return rest.starts_with("\n\r") ? "\n\r" : rest.starts_with('\r') && !rest.starts_with("\r\n") ? "\r" : "\n";
}

PlyHeader parse_header(std::string_view bytes, const fs::path& file) {
    PlyHeader header;
    const std::string_view line_end = line_end_of(bytes);
    bool format_seen = false;
    int number = 0;
    for (std::size_t at = 0; at < std::min(bytes.size(), longest_ply_header);) {
        const std::size_t end = std::min(bytes.find(line_end, at), bytes.size());
        const auto line = words(bytes.substr(at, end - at));
        at = std::min(end + line_end.size(), bytes.size());
        ++number;
        const std::string_view key = line.empty() ? std::string_view() : line[0];
        if (number == 1 || key.empty() || key == "comment")
            continue; // line 1 is "ply"
        if (key == "obj_info") {
            if (line.size() == 3 && line[1] == "num_cols")
                header.columns = whole_number(line[2]);
            if (line.size() == 3 && line[1] == "num_rows")
                header.rows = whole_number(line[2]);
        } else if (key == "format") {
            header.encoding = encoding_named(line, file, number);
            format_seen = true;
        } else if (key == "element") {
            header.elements.push_back(element_of(line, file, number, at));
        } else if (key == "property") {
            if (header.elements.empty())
                throw Error(at_line(file, number) + ": a property before the first element");
            header.elements.back().properties.push_back(property_of(line, file, number));
            header.elements.back().properties_end = at;
        } else if (key == "end_header") {
            if (!format_seen)
                throw Error(file.string() + ": no format line in the header");
            header.length = at;
            header.next_line = number + 1;
            return header;
        } else {
            throw Error(fmt::format("{}: {} is no header entry, and no end_header came before it",
                                    at_line(file, number), in_quotes(key)));
        }
    }
    throw Error(file.string() + ": no end_header line");
}

// --- body ---

/// Walks through the body's elements in order, and checks every length before using it.
class BodyWalk {
  public:
    BodyWalk(std::string_view body, const PlyHeader& header, const fs::path& file)
        : body_(body), encoding_(header.encoding), text_(body, header.next_line), file_(file) {}

    /// Skips all records of `element`. Calls `record(index, start, end)` for each when lengths vary or `record` needs
    /// it.
    template <class OnRecord>
    void walk(const Element& element, OnRecord&& record) {
        if (element.properties.empty() && element.count > 0)
            throw Error(fmt::format("{}: element {} has no properties", at_line(file_, element.line), element.name));
        for (std::uint64_t i = 0; i < element.count; ++i) {
            const std::size_t start = at_;
            encoding_ == Encoding::ascii ? pass_line(element, i) : pass_bytes(element, i);
            record(i, start, at_);
        }
    }

    /// Records of one size, checked as a whole.
    void skip_fixed(const Element& element) {
        const std::size_t stride = element.least_bytes(), left = body_.size() - at_;
        if (stride == 0 && element.count > 0)
            throw Error(fmt::format("{}: element {} has no properties", at_line(file_, element.line), element.name));
        if (stride > 0 && element.count > left / stride)
            too_short(element, left / stride);
        at_ += element.count * stride;
    }

    [[nodiscard]] std::size_t at() const { return at_; }
    [[nodiscard]] std::string_view body() const { return body_; }
    [[nodiscard]] const std::vector<std::string_view>& line_words() const { return text_.words(); }
    [[nodiscard]] bool more_text() { return text_.next(); }

  private:
    [[noreturn]] void too_short(const Element& element, std::uint64_t found) const {
        throw Error(
            fmt::format("{}: the header says {} of element {}, the file holds {} (it ends at byte {} of its body)",
                        file_.string(), element.count, element.name, found, body_.size()));
    }

    void pass_bytes(const Element& element, std::uint64_t index) {
        for (const CloudField& p : element.properties) {
            std::size_t length = p.bytes();
            if (p.list_length) {
                const std::size_t head = size_of(*p.list_length);
                if (head > body_.size() - at_)
                    too_short(element, index);
                const double count = decoded(body_.data() + at_, *p.list_length, encoding_ == Encoding::big_endian);
                at_ += head;
                const std::size_t most = (body_.size() - at_) / size_of(p.type);
                if (count < 0 || count > static_cast<double>(most))
                    throw Error(fmt::format("{}: element {}, record {}: list {} claims {} values, {} bytes are left",
                                            file_.string(), element.name, index + 1, in_quotes(p.name), count,
                                            body_.size() - at_));
                length = static_cast<std::size_t>(count) * size_of(p.type);
            }
            if (length > body_.size() - at_)
                too_short(element, index);
            at_ += length;
        }
    }

    void pass_line(const Element& element, std::uint64_t index) {
        if (!text_.next())
            too_short(element, index);
        const auto& line = text_.words();
        std::size_t expected = 0;
        for (const CloudField& p : element.properties) {
            double values = 1;
            if (p.list_length && expected < line.size()) {
                values = 1 + number(line[expected]).value_or(-2);
                if (!(values >= 1 && values <= static_cast<double>(line.size())))
                    throw Error(fmt::format("{}: list {} claims {} values in a line of {}",
                                            at_line(file_, text_.line()), in_quotes(p.name), in_quotes(line[expected]),
                                            line.size()));
            }
            expected += static_cast<std::size_t>(values);
        }
        if (expected != line.size())
            throw Error(fmt::format("{}: {}, expected {} (record {} of element {})", at_line(file_, text_.line()),
                                    counted(line.size(), "value"), expected, index + 1, element.name));
        for (const auto word : line)
            if (!number(word))
                throw Error(fmt::format("{}: {} is not a number", at_line(file_, text_.line()), in_quotes(word)));
        at_ = text_.end();
    }

    std::string_view body_;
    Encoding encoding_;
    TextRecords text_;
    const fs::path& file_;
    std::size_t at_ = 0;
};

std::optional<std::size_t> index_list(const Element& element) {
    for (std::size_t i = 0; i < element.properties.size(); ++i) {
        const CloudField& p = element.properties[i];
        if (p.list_length && (p.name == "vertex_indices" || p.name == "vertex_index"))
            return i;
    }
    return std::nullopt;
}

/// Reads the vertex indices of face records, or another list of theirs.
class FaceIndices {
  public:
    FaceIndices(const Element& faces, const PlyHeader& header) : FaceIndices(faces, header, *index_list(faces)) {}
    FaceIndices(const Element& faces, const PlyHeader& header, std::size_t list) : list_(list) {
        view_.encoding = header.encoding;
        view_.fields = faces.properties;
    }

    /// Calls visit(number) for each index in the record.
    template <class Visit>
    void for_each(std::string_view record, Visit&& visit) const {
        const FieldPlace place = locate(view_, record, list_);
        const std::string_view list = record.substr(place.offset, place.length);
        if (view_.text()) {
            const auto all = words(list);
            for (std::size_t i = 1; i < all.size(); ++i)
                visit(number(all[i]).value_or(-1));
            return;
        }
        const CloudField& p = view_.fields[list_];
        for (std::size_t at = size_of(*p.list_length); at < list.size(); at += size_of(p.type))
            visit(decoded(list.data() + at, p.type, view_.encoding == Encoding::big_endian));
    }

  private:
    CloudRecords view_; ///< only to find a face's list
    std::size_t list_;
};

/// An index that names no vertex is worth a warning, not a refusal.
class FaceCheck {
  public:
    FaceCheck(const Element& faces, const PlyHeader& header, std::size_t vertices)
        : indices_(faces, header), vertices_(static_cast<double>(vertices)) {}

    void look_at(std::uint64_t index, std::string_view record) {
        indices_.for_each(record, [&](double vertex) { judge(index, vertex); });
    }

    void report(const fs::path& file, std::vector<std::string>& warnings) const {
        if (bad_ > 0)
            warnings.push_back(
                fmt::format("{}: face {} names vertex {} of {}{}; the points are used, the faces are written back "
                            "as they are.",
                            file.string(), first_face_ + 1, first_vertex_, vertices_,
                            bad_ > 1 ? fmt::format(", and {} more indices are wrong", bad_ - 1) : ""));
    }

  private:
    void judge(std::uint64_t face, double vertex) {
        if (vertex >= 0 && vertex < vertices_)
            return;
        if (bad_++ > 0)
            return;
        first_face_ = face;
        first_vertex_ = vertex;
    }

    FaceIndices indices_;
    double vertices_;
    std::size_t bad_ = 0;
    std::uint64_t first_face_ = 0;
    double first_vertex_ = 0;
};

void read_vertices(CloudRecords& records, BodyWalk& walk, const Element& vertex) {
    const std::size_t start = walk.at();
    records.before = walk.body().substr(0, start);
    if (records.text() || vertex.lists()) {
        walk.walk(vertex, [&](std::uint64_t, std::size_t, std::size_t end) { records.ends.push_back(end - start); });
    } else {
        records.stride = vertex.least_bytes();
        walk.skip_fixed(vertex);
    }
    records.points = walk.body().substr(start, walk.at() - start);
}

void skip(BodyWalk& walk, const Element& element, const PlyHeader& header) {
    if (header.encoding == Encoding::ascii || element.lists())
        walk.walk(element, [](std::uint64_t, std::size_t, std::size_t) {});
    else
        walk.skip_fixed(element);
}

void pass_over(BodyWalk& walk, const Element& element, const PlyHeader& header, std::size_t vertices,
               const fs::path& file, std::vector<std::string>& warnings) {
    if (element.name == "face" && index_list(element)) {
        FaceCheck faces(element, header, vertices);
        walk.walk(element, [&](std::uint64_t index, std::size_t start, std::size_t end) {
            faces.look_at(index, walk.body().substr(start, end - start));
        });
        faces.report(file, warnings);
    } else {
        skip(walk, element, header);
    }
}

const Element& vertex_element(const PlyHeader& header, const fs::path& file) {
    const Element* vertex = nullptr;
    for (const Element& element : header.elements) {
        if (element.name != "vertex")
            continue;
        if (vertex)
            throw Error(at_line(file, element.line) + ": a second element vertex");
        vertex = &element;
    }
    if (!vertex)
        throw Error(file.string() + ": no element vertex in the header");
    for (const auto* name : {"x", "y", "z"}) {
        const bool there = std::any_of(vertex->properties.begin(), vertex->properties.end(),
                                       [&](const CloudField& p) { return is_named(p, name) && !p.list_length; });
        if (!there)
            throw Error(fmt::format("{}: element vertex has no property {}", at_line(file, vertex->line), name));
    }
    return *vertex;
}

cv::Size grid_of(const PlyHeader& header, std::uint64_t vertices) {
    const auto columns = header.columns.value_or(0), rows = header.rows.value_or(0);
    const bool organised =
        columns > 0 && rows > 1 && columns <= vertices && rows <= vertices && columns * rows == vertices;
    if (organised)
        return {static_cast<int>(columns), static_cast<int>(rows)};
    return {static_cast<int>(vertices), 1};
}

} // namespace

CloudRecords read_ply(std::string_view bytes, const fs::path& file, std::vector<std::string>& warnings) {
    const PlyHeader header = parse_header(bytes, file);
    const Element& vertex = vertex_element(header, file);
    CloudRecords records;
    records.encoding = header.encoding;
    records.header = bytes.substr(0, header.length);
    records.fields = vertex.properties;
    records.point_count = vertex.count;
    records.grid = grid_of(header, vertex.count);
    std::size_t offset = 0;
    for (CloudField& field : records.fields) {
        field.offset = offset;
        offset += field.bytes();
    }

    BodyWalk walk(bytes.substr(header.length), header, file);
    std::size_t vertices_end = 0;
    for (const Element& element : header.elements) {
        if (&element == &vertex) {
            read_vertices(records, walk, element);
            vertices_end = walk.at();
        } else {
            pass_over(walk, element, header, vertex.count, file, warnings);
        }
    }
    records.after = walk.body().substr(vertices_end);
    records.splats = during(file.string(), [&] { return splats_of(records); });
    const std::size_t left = walk.body().size() - walk.at();
    if (records.text() ? walk.more_text() : left > 0)
        warnings.push_back(fmt::format("{}: {} after the last element; written back as they are.", file.string(),
                                       counted(left, "byte")));
    return records;
}

std::size_t PlyTable::offset_of(const std::string& field, Scalar type) const {
    const auto found = std::ranges::find(fields, field, &CloudField::name);
    if (found == fields.end() || found->type != type)
        throw Error(fmt::format("element {} has no property {} of {} bytes as expected", name, field, size_of(type)));
    return found->offset;
}

std::vector<PlyTable> ply_tables(std::string_view bytes, const fs::path& file) {
    const PlyHeader header = parse_header(bytes, file);
    if (header.encoding != Encoding::binary)
        throw Error(file.string() + ": packed splats are read from binary_little_endian");
    BodyWalk walk(bytes.substr(header.length), header, file);
    std::vector<PlyTable> tables;
    for (const Element& element : header.elements) {
        if (element.lists())
            throw Error(fmt::format("{}: element {} has lists", at_line(file, element.line), element.name));
        PlyTable& table = tables.emplace_back(
            PlyTable{element.name, element.properties, element.count, 0, header.length + walk.at()});
        for (CloudField& field : table.fields) {
            field.offset = table.stride;
            table.stride += field.bytes();
        }
        walk.skip_fixed(element);
    }
    return tables;
}

CloudShape ply_shape(const FileBytes& file, std::vector<std::string>& warnings) {
    CloudShape shape;
    const fs::path& path = file.path();
    const std::string start = file.bytes(0, std::min<std::uint64_t>(file.size(), longest_ply_header));
    const PlyHeader header = parse_header(start, path);
    const Element& vertex = vertex_element(header, path);
    CloudRecords& records = shape.records;
    records.encoding = header.encoding;
    records.header = start.substr(0, header.length);
    records.fields = vertex.properties;
    records.point_count = vertex.count;
    records.grid = grid_of(header, vertex.count);
    for (CloudField& field : records.fields) {
        field.offset = records.stride;
        records.stride += field.bytes();
    }
    const bool splats = during(path.string(), [&] { return splat_fields(records).has_value(); });
    if (records.text() || vertex.lists() || splats) {
        shape.whole_since = splats           ? "its points are Gaussian splats"
                            : records.text() ? "it is text"
                                             : "its points hold lists";
        return shape;
    }
    constexpr std::uint64_t most_before = 16 << 20;
    std::uint64_t at = header.length;
    bool behind = false, last = false;
    for (const Element& element : header.elements) {
        last = &element == &vertex;
        if (element.name == "face" && index_list(element) && element.count > 0)
            shape.whole_since = "it has faces";
        else if (!last && !behind && (element.lists() || element.count * element.least_bytes() > most_before))
            shape.whole_since = fmt::format("element {} comes before the points", element.name);
        if (!shape.whole_since.empty())
            return shape;
        const std::uint64_t left = file.size() - at, stride = element.least_bytes();
        if (behind)
            continue;
        if (element.count > 0 && (stride == 0 || element.count > left / stride))
            throw Error(fmt::format("{}: the header says {} of element {}, the file holds {}", path.string(),
                                    element.count, element.name, stride == 0 ? 0 : left / stride));
        if (last)
            shape.at = at;
        else
            records.before += file.bytes(at, element.count * stride);
        at += element.count * stride;
        behind = last;
    }
    shape.end = at;
    if (last && file.size() > at)
        warnings.push_back(fmt::format("{}: {} after the last element; written back as they are.", path.string(),
                                       counted(file.size() - at, "byte")));
    return shape;
}

namespace {

/// Calls visit(element, corners, record) for each face that lists vertices; -1 for an index that names none.
template <class Visit>
void for_each_face(const CloudRecords& records, const PlyHeader& header, Visit&& visit) {
    const fs::path name = "mesh";
    BodyWalk before(records.before, header, name), after(records.after, header, name);
    BodyWalk* walk = &before;
    for (const Element& element : header.elements) {
        if (element.name == "vertex") {
            walk = &after;
        } else if (element.name == "face" && index_list(element)) {
            const FaceIndices indices(element, header);
            std::vector<int> corners;
            walk->walk(element, [&](std::uint64_t, std::size_t start, std::size_t end) {
                corners.clear();
                const std::string_view record = walk->body().substr(start, end - start);
                indices.for_each(record, [&](double vertex) {
                    const bool named = vertex >= 0 && vertex < static_cast<double>(records.point_count);
                    corners.push_back(named ? static_cast<int>(vertex) : -1);
                });
                visit(element, corners, record);
            });
        } else {
            skip(*walk, element, header);
        }
    }
}

/// Two fields of the vertices that hold texture coordinates, by the names that programs give them.
std::optional<std::array<std::size_t, 2>> coordinate_fields(const CloudRecords& records) {
    for (const auto& names :
         {std::array{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}, {"texture_s", "texture_t"}}) {
        const auto u = records.field_named(names[0]), v = records.field_named(names[1]);
        if (u && v)
            return std::array{*u, *v};
    }
    return std::nullopt;
}

/// A number of a face: which texture it uses.
int texture_number(const Element& faces, const PlyHeader& header, std::string_view record) {
    const auto field = std::ranges::find(faces.properties, std::string("texnumber"), &CloudField::name);
    if (field == faces.properties.end() || field->list_length)
        return 0;
    CloudRecords view;
    view.encoding = header.encoding;
    view.fields = faces.properties;
    const double number = value_at(view, record, static_cast<std::size_t>(field - faces.properties.begin()));
    constexpr double most = 1e6;
    return number >= 0 && number < most ? static_cast<int>(number) : 0;
}

/// The mesh of a PLY, face by face.
class PlyTexture {
  public:
    explicit PlyTexture(const CloudRecords& records)
        : records_(records), header_(parse_header(records.header, "mesh")), fields_(coordinate_fields(records)) {
        if (const auto normals = normal_fields(records))
            normals_ = normals_of(records, *normals);
        if (!normals_.empty()) {
            PointOddities unheard;
            points_ = points_of(records, unheard);
        }
    }

    TexturedMesh mesh() {
        mesh_.tiles = true;
        for_each_face(records_, header_, [&](const Element& faces, const std::vector<int>& corners, auto record) {
            places_.clear();
            const auto list = std::ranges::find(faces.properties, std::string("texcoord"), &CloudField::name);
            if (list != faces.properties.end() && list->list_length)
                FaceIndices(faces, header_, static_cast<std::size_t>(list - faces.properties.begin()))
                    .for_each(record, [&](double number) { places_.push_back(static_cast<float>(number)); });
            take(corners, material(texture_number(faces, header_, record)));
        });
        if (!any_)
            mesh_.sets.clear();
        return std::move(mesh_);
    }

  private:
    int material(int number) {
        const auto [row, is_new] = materials_.try_emplace(number, static_cast<int>(materials_.size()));
        if (is_new)
            mesh_.materials.push_back({std::to_string(number)});
        return row->second;
    }

    [[nodiscard]] Eigen::Vector2f place(std::size_t corner, int vertex, std::size_t corners) const {
        constexpr float nan = std::numeric_limits<float>::quiet_NaN();
        if (places_.size() == 2 * corners)
            return {places_[2 * corner], 1 - places_[2 * corner + 1]};
        if (!fields_ || vertex < 0)
            return {nan, nan};
        const std::string_view record = records_.record(static_cast<std::size_t>(vertex));
        return {static_cast<float>(value_at(records_, record, (*fields_)[0])),
                static_cast<float>(1 - value_at(records_, record, (*fields_)[1]))};
    }

    void take(const std::vector<int>& corners, int material) {
        if (mesh_.sets.empty())
            mesh_.sets.emplace_back();
        any_ = any_ || fields_ || !places_.empty();
        for (std::size_t i = 2; i < corners.size(); ++i) {
            const std::array<std::size_t, 3> of{0, i - 1, i};
            std::array<int, 3> triangle{};
            TextureCorners places;
            for (std::size_t k = 0; k < 3; ++k) {
                triangle[k] = corners[of[k]];
                places[k] = place(of[k], corners[of[k]], corners.size());
            }
            mesh_.triangles.push_back(triangle);
            mesh_.sets[0].push_back(places);
            mesh_.material.push_back(material);
            if (!normals_.empty())
                mesh_.reversed.push_back(reversed(triangle));
        }
    }

    [[nodiscard]] bool reversed(const std::array<int, 3>& triangle) const {
        std::array<Eigen::Vector3d, 3> at;
        Eigen::Vector3d sum = Eigen::Vector3d::Zero();
        for (std::size_t k = 0; k < 3; ++k) {
            if (triangle[k] < 0)
                return false;
            at[k] = points_[static_cast<std::size_t>(triangle[k])];
            sum += normals_[static_cast<std::size_t>(triangle[k])];
        }
        return is_reversed(at, sum);
    }

    const CloudRecords& records_;
    PlyHeader header_;
    std::optional<std::array<std::size_t, 2>> fields_;
    std::vector<Eigen::Vector3d> normals_, points_;
    std::vector<float> places_; ///< of the face at hand
    std::map<int, int> materials_;
    bool any_ = false;
    TexturedMesh mesh_;
};

} // namespace

std::vector<std::array<int, 3>> ply_triangles(const CloudRecords& records) {
    std::vector<std::array<int, 3>> triangles;
    for_each_face(records, parse_header(records.header, "mesh"),
                  [&](const Element&, const std::vector<int>& corners, std::string_view) {
                      for (std::size_t i = 2; i < corners.size(); ++i)
                          triangles.push_back({corners[0], corners[i - 1], corners[i]});
                  });
    return triangles;
}

TexturedMesh ply_texture(const CloudRecords& records, const fs::path&) { return PlyTexture(records).mesh(); }

LinkedFiles with_ply_links(const LinkRequest& asked) {
    LinkedFiles made;
    const CloudRecords& records = asked.records;
    made.files.push_back(
        {asked.name + ".ply", between(records.header, records.before + records.points, records.after)});
    constexpr std::string_view comment = "comment TextureFile ";
    for (const TextLine& line : text_lines(records.header))
        if (line.text.starts_with(comment))
            if (const auto path = path_within(trimmed(line.text.substr(comment.size()))))
                made.copies.push_back(*path);
    for (const OcclusionLink& link : asked.links)
        made.notes.push_back(
            fmt::format("{} is not linked: one more TextureFile in a PLY would renumber the others.", link.image));
    return made;
}

std::string ply_bytes(const CloudRecords& records, std::string points, const std::vector<FieldAddition>& additions) {
    std::string header = records.header;
    const PlyHeader parsed = parse_header(header, "cloud");
    const Element& vertex = vertex_element(parsed, "cloud");
    const std::string line_end(header.substr(0, vertex.properties_end).ends_with("\r\n") ? "\r\n"
                                                                                         : line_end_of(header));
    std::string lines;
    for (const FieldAddition& addition : additions)
        lines += (addition.type == Scalar::uint8 ? "property uchar " : "property float ") + addition.name + line_end;
    header.insert(vertex.properties_end, lines);
    return between(header + records.before, std::move(points), records.after);
}

} // namespace scanshade
