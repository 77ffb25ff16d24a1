{{/*
A service account, a deployment and a disruption budget for one service. Takes a dict:
  root       $
  service    its name: the program's subcommand and the component label
  settings   its part of the values
  ports      list of dicts with `name` and `port`
  health     name of the port with /healthz, /readyz and /metrics
  needs      list of store, kafka, postgis, cluster, renderWorkers
  single     true where there must never be two
  own        dict of settings that only this service has; a %s in a value becomes drainSeconds
*/}}
{{- define "fluxglobe.workload" -}}
{{- $name := printf "%s-%s" (include "fluxglobe.fullname" .root) .service -}}
{{- $gpu := .settings.gpu | default (dict "enabled" false) -}}
{{- $autoscaling := .settings.autoscaling | default (dict "enabled" false) -}}
{{- $secrets := include "fluxglobe.secrets" . | fromJson -}}
apiVersion: v1
kind: ServiceAccount
metadata:
  name: {{ $name }}
  labels: {{- include "fluxglobe.labels" . | nindent 4 }}
  {{- with .settings.serviceAccountAnnotations }}
  annotations: {{- toYaml . | nindent 4 }}
  {{- end }}
automountServiceAccountToken: false
---
apiVersion: apps/v1
kind: Deployment
metadata:
  name: {{ $name }}
  labels: {{- include "fluxglobe.labels" . | nindent 4 }}
spec:
  {{- if .single }}
  replicas: 1
  strategy: {type: Recreate}
  {{- else }}
  {{- if not $autoscaling.enabled }}
  replicas: {{ .settings.replicas }}
  {{- end }}
  strategy: {type: RollingUpdate, rollingUpdate: {maxUnavailable: 0, maxSurge: 1}}
  {{- end }}
  revisionHistoryLimit: 3
  selector:
    matchLabels: {{- include "fluxglobe.selector" . | nindent 6 }}
  template:
    metadata:
      labels: {{- include "fluxglobe.labels" . | nindent 8 }}
      annotations:
        kubectl.kubernetes.io/default-container: {{ .service }}
    spec:
      serviceAccountName: {{ $name }}
      automountServiceAccountToken: false
      # Otherwise Kubernetes adds variables such as FLUXGLOBE_SCHEDULER_PORT, which look like settings of ours.
      enableServiceLinks: false
      terminationGracePeriodSeconds: {{ add .settings.drainSeconds 15 }}
      {{- with .root.Values.image.pullSecrets }}
      imagePullSecrets: {{- toYaml . | nindent 8 }}
      {{- end }}
      {{- if and $gpu.enabled $gpu.runtimeClassName }}
      runtimeClassName: {{ $gpu.runtimeClassName }}
      {{- end }}
      {{- with ternary (merge (dict) .settings.nodeSelector ($gpu.nodeSelector | default dict)) .settings.nodeSelector $gpu.enabled }}
      nodeSelector: {{- toYaml . | nindent 8 }}
      {{- end }}
      {{- with ternary (concat .settings.tolerations ($gpu.tolerations | default list)) .settings.tolerations $gpu.enabled }}
      tolerations: {{- toYaml . | nindent 8 }}
      {{- end }}
      {{- if not .single }}
      topologySpreadConstraints:
        - maxSkew: 1
          topologyKey: kubernetes.io/hostname
          whenUnsatisfiable: ScheduleAnyway
          labelSelector:
            matchLabels: {{- include "fluxglobe.selector" . | nindent 14 }}
      {{- end }}
      securityContext: {{- include "fluxglobe.podSecurity" . | nindent 8 }}
      containers:
        - name: {{ .service }}
          image: {{ include "fluxglobe.image" .root | quote }}
          imagePullPolicy: {{ .root.Values.image.pullPolicy }}
          args: [{{ .service }}]
          ports:
            {{- range .ports }}
            - {name: {{ .name }}, containerPort: {{ .port }}}
            {{- end }}
          env:
            - {name: FLUXGLOBE_LOG, value: {{ .root.Values.log | quote }}}
            - {name: FLUXGLOBE_LOG_FORMAT, value: json}
            {{- range $key, $value := .own }}
            - {name: {{ $key }}, value: {{ $value | replace "%s" (toString $.settings.drainSeconds) | quote }}}
            {{- end }}
            {{- range .ports }}{{ if eq .name "admin" }}
            - {name: FLUXGLOBE_ADMIN, value: "0.0.0.0:{{ .port }}"}
            {{- end }}{{ end }}
            {{- if $gpu.enabled }}
            # Without its GPU a pod says so and starts again: drawing in software on a GPU's node helps nobody.
            - {name: FLUXGLOBE_REQUIRE_GPU, value: "true"}
            {{- end }}
            {{- range .needs }}
            {{- include (printf "fluxglobe.environment.%s" .) $.root | nindent 12 }}
            {{- end }}
            {{- range $key, $value := .settings.environment }}
            - {name: {{ $key }}, value: {{ $value | quote }}}
            {{- end }}
          {{- if and (has "store" .needs) .root.Values.store.secretName }}
          envFrom:
            - secretRef: {name: {{ .root.Values.store.secretName }}}
          {{- end }}
          startupProbe:
            httpGet: {path: /healthz, port: {{ .health }}}
            periodSeconds: 2
            failureThreshold: 60
          livenessProbe:
            httpGet: {path: /healthz, port: {{ .health }}}
            periodSeconds: 10
            timeoutSeconds: 5
            failureThreshold: 3
          readinessProbe:
            httpGet: {path: /readyz, port: {{ .health }}}
            periodSeconds: 5
            timeoutSeconds: 3
            failureThreshold: 2
          # Time for the endpoints to forget this pod before it stops listening.
          lifecycle: {preStop: {sleep: {seconds: 5}}}
          resources:
            {{- $resources := deepCopy .settings.resources }}
            {{- if $gpu.enabled }}
            {{- $_ := set $resources "limits" (set ($resources.limits | default dict) $gpu.resource $gpu.count) }}
            {{- end }}
            {{- toYaml $resources | nindent 12 }}
          securityContext: {{- include "fluxglobe.containerSecurity" . | nindent 12 }}
          volumeMounts:
            - {name: tmp, mountPath: /tmp}
            # Files that are worked on; what is there when the pod goes is not missed.
            - {name: data, mountPath: /data}
            {{- include "fluxglobe.secretMounts" $secrets | nindent 12 }}
      volumes:
        - {name: tmp, emptyDir: {}}
        - {name: data, emptyDir: {}}
        {{- include "fluxglobe.secretVolumes" $secrets | nindent 8 }}
---
apiVersion: policy/v1
kind: PodDisruptionBudget
metadata:
  name: {{ $name }}
  labels: {{- include "fluxglobe.labels" . | nindent 4 }}
spec:
  # One at a time may go, also where there is only one: whatever it had begun is handed back and begun again elsewhere.
  maxUnavailable: 1
  unhealthyPodEvictionPolicy: AlwaysAllow
  selector:
    matchLabels: {{- include "fluxglobe.selector" . | nindent 6 }}
{{- end }}
